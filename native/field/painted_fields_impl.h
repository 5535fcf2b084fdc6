// What the files of PaintedFields share.
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

// Calls `visit` with the layer of a channel.
template <class Layers, class Visit>
auto with_layer(Layers& layers, Channel channel, const Visit& visit) {
  switch (channel) {
    case Channel::mean:
      return visit(layers.mean);
    case Channel::deviation:
      return visit(layers.sigma);
    case Channel::albedo:
      return visit(layers.albedo);
    default:
      return visit(layers.anisotropy);
  }
}

// The value of a layer at any point, without its grids the constant.
template <class Kind>
typename Kind::Value constant_of(const PaintLayers& layers);
template <>
inline double constant_of<ScalarLayer>(const PaintLayers& layers) {
  return layers.constant_sigma;
}
template <>
inline Vec3 constant_of<ColorLayer>(const PaintLayers&) {
  return {1, 1, 1};
}
template <>
inline SymMat3 constant_of<TensorLayer>(const PaintLayers& layers) {
  return layers.constant_anisotropy;
}

}  // namespace gpis
