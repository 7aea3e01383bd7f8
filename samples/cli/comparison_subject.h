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
  std::optional<BuiltInScenes> builtIn;  ///< if a picture is drawn
  std::optional<Scene> model;            ///< empty: the built-in arm
  std::string name;                      ///< of the model, as requested
  std::string poseName;                  ///< "rest pose", "clip 0 'walk' at 0.341 s"
  ScenePose pose;

  const Scene& scene() const { return model ? *model : builtIn->arm; }
};

/// The default columns of a picture: those of the usual methods that the scene allows.
std::vector<Method> usualColumns(const Scene& scene);

/// Describes the picture of a subject with built-in scenes: these first, then the model with the
/// cost of skinning it, and the heat map. Refers to the subject.
ComparisonSheet describeSheet(const ComparisonSubject& subject, const std::vector<Method>& columns,
                              const ComparisonTitle& title, const MethodComparison& comparison);

}  // namespace dermis::cli
