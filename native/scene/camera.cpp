#include "scene/camera.h"

namespace gpis {

Camera::Camera(const CameraDescription& description, int width, int height)
    : description_(description),
      image_width_(width),
      image_height_(height),
      right_(normalize(description.matrix.vector({1, 0, 0}))),
      up_(normalize(description.matrix.vector({0, 1, 0}))),
      back_(normalize(description.matrix.vector({0, 0, 1}))),
      position_(description.matrix.translation) {
  const bool perspective = description.type == CameraDescription::Type::perspective;
  const double frame = perspective ? 2 * std::tan(description.fov_x / 2) : description.width;
  const double larger_side = std::max(width, height);
  pixel_size_ = frame / width;
  center_x_ = 0.5 * width - description.shift_x * larger_side;
  center_y_ = 0.5 * height - description.shift_y * larger_side;
}

CameraRay Camera::ray(double x, double y) const {
  const double clip_near = description_.clip_near, clip_far = description_.clip_far;
  const double u = (x - center_x_) * pixel_size_, v = (y - center_y_) * pixel_size_;
  switch (description_.type) {
    case CameraDescription::Type::orthographic: {
      const Vec3 origin = position_ + right_ * u + up_ * v - back_ * clip_near;
      return {{origin, -back_}, clip_far - clip_near, clip_near, 1};
    }
    case CameraDescription::Type::equirectangular: {
      // The centre of the image looks along -z, its full width turns once about y.
      const double longitude = (x / image_width_ - 0.5) * 2 * kPi;
      const double latitude = (y / image_height_ - 0.5) * kPi;
      const Vec3 d =
          normalize(right_ * (std::sin(longitude) * std::cos(latitude)) + up_ * std::sin(latitude) -
                    back_ * (std::cos(longitude) * std::cos(latitude)));
      return {{position_ + d * clip_near, d}, clip_far - clip_near, clip_near, 1};
    }
    case CameraDescription::Type::perspective:
      break;
  }
  const Vec3 to_plane = right_ * u + up_ * v - back_;
  const double per_depth = length(to_plane);  // 1 / cosine with the viewing axis
  const Vec3 d = to_plane / per_depth;
  return {{position_ + to_plane * clip_near, d},
          (clip_far - clip_near) * per_depth,
          clip_near,
          1 / per_depth};
}

}  // namespace gpis
