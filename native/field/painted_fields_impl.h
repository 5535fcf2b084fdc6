// What painted_fields.cpp and painted_file.cpp share.
#pragma once

#include "field/paint_layers.h"
#include "field/painted_fields.h"

namespace gpis {

struct PaintedFields::Impl {
  PaintLayers layers;
  openvdb::GridPtrVec others;  // of the source's file, carried along

  void open(const PaintSource& source);
  void make(Channel channel);  // the layer of a channel, if it is not there
};

}  // namespace gpis
