// Skins a scene, part by part, with the reference or on a device: what `skin` writes.
#pragma once

#include <functional>
#include <vector>

#include "batch_layout.h"
#include "bind_pose.h"
#include "dermis/method.h"
#include "dermis/vulkan/context.h"
#include "device.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// Every part of the scene in a pose. Tangents where they are wanted and a mesh has them.
using SkinParts = std::function<Result<std::vector<SkinnedPart>>(const ScenePose& pose)>;

/// What a batch needs of each part that has a mesh, in the order of the parts; they refer to the
/// scene and the pose.
std::vector<samples::SkinRequest> skinRequests(const Scene& scene, const ScenePose& pose);

/// Both refer to the scene, and the second to the device and its context.
SkinParts referenceSkinner(const Scene& scene, Method method);
SkinParts deviceSkinner(const Scene& scene, Method method, bool tangents, samples::Device& device,
                        vulkan::Context& context);

}  // namespace dermis::cli
