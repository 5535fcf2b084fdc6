// Which stochastic surfaces stand alone: nothing else that rays end on reaches into their bounds.
#pragma once

#include "scene/scene_impl.h"

namespace gpis {

// Tells those surfaces, once all objects are built. Throws std::invalid_argument with a sentence
// where one asks for a sampler that needs it and has company.
void find_alone(const SceneDescription& description, Scene::Impl& scene);

}  // namespace gpis
