// The subject of `compare`: a model in a pose, or the built-in arm.
#pragma once

#include <optional>
#include <string>

#include "built_in_scenes.h"
#include "comparison.h"
#include "comparison_picture.h"
#include "comparison_report.h"
#include "skinned_scene.h"

namespace dermis::cli {

struct ComparisonSubject {
  std::optional<BuiltInScenes> builtIn;  ///< where there is a picture
  std::optional<Scene> model;            ///< nothing: it is the built-in arm
  std::string name;                      ///< of the model, as it was asked for
  std::string poseName;                  ///< "rest pose", "clip 0 'walk' at 0.341 s"
  ScenePose pose;

  const Scene& scene() const { return model ? *model : builtIn->arm; }
};

/// The default columns of a picture: those that the scene allows.
std::vector<Method> usualColumns(const Scene& scene);

/// A picture of a subject with built-in scenes: these, then the model with what skinning it takes,
/// and the heat map. Refers to the subject.
ComparisonSheet describeSheet(const ComparisonSubject& subject, const std::vector<Method>& columns,
                              const ComparisonTitle& title, const MethodComparison& comparison);

}  // namespace dermis::cli
