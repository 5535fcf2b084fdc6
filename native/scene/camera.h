// Camera rays, by Blender's conventions: the camera looks along -z with y up, its scale is ignored,
// `fov_x` and `width` span the frame from left to right, `shift` moves the frame by that many times
// its larger side, `clip` are distances along the viewing axis (from the camera, for
// equirectangular ones). Points of the image are in pixels from its lower left corner.
#pragma once

#include "core/vec.h"
#include "scene/description.h"

namespace gpis {

struct CameraRay {
  Ray ray;                          // starts on the near clip distance
  double t_max;                     // the far clip distance
  double depth_start, depth_scale;  // depth pass at t: depth_start + t * depth_scale

  double depth(double t) const { return depth_start + t * depth_scale; }
};

class Camera {
 public:
  // `width` and `height` of the image in pixels. The description has passed check()
  // (scene/check.h).
  Camera(const CameraDescription& description, int width, int height);
  CameraRay ray(double x, double y) const;

 private:
  CameraDescription description_;
  double image_width_, image_height_;
  Vec3 right_, up_, back_, position_;
  double pixel_size_;  // on the plane at distance 1 (perspective) or in metres (orthographic)
  double center_x_, center_y_;  // where the viewing axis meets the image
};

}  // namespace gpis
