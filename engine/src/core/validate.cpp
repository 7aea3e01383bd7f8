#include "dermis/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "attribute.h"
#include "check_mesh.h"
#include "strict_floating_point.h"
#include "text.h"

namespace dermis {
namespace {

constexpr std::size_t problemCount = static_cast<std::size_t>(MeshProblem::tangentSign) + 1;

/// Collects at most one finding a kind; the sentence is made for its first place only.
class Findings {
 public:
  explicit Findings(std::string_view meshName) : prefix_("mesh " + inQuotes(meshName)) {}

  void addView(MeshProblem problem, const std::string& text) {
    MeshReport::Finding& finding = findings_[static_cast<std::size_t>(problem)];
    if (finding.count++ == 0) finding.message = prefix_ + ": " + text;
  }

  template <typename MakeText>
  void addVertex(MeshProblem problem, std::uint32_t vertex, MakeText&& makeText) {
    const MeshReport::Finding& finding = findings_[static_cast<std::size_t>(problem)];
    // Several influences of one vertex may have the same problem: it counts once.
    if (finding.count != 0 && lastVertex_[static_cast<std::size_t>(problem)] == vertex) return;
    lastVertex_[static_cast<std::size_t>(problem)] = vertex;
    addEach(problem, vertex, makeText);
  }

  template <typename MakeText>
  void addEach(MeshProblem problem, std::uint32_t vertex, MakeText&& makeText) {
    MeshReport::Finding& finding = findings_[static_cast<std::size_t>(problem)];
    if (finding.count++ == 0) {
      finding.firstVertex = vertex;
      finding.message = prefix_ + ", vertex " + std::to_string(vertex) + ": " + makeText();
    }
  }

  MeshReport take() {
    MeshReport report;
    for (std::size_t kind = 0; kind < problemCount; ++kind) {
      if (findings_[kind].count == 0) continue;
      findings_[kind].problem = static_cast<MeshProblem>(kind);
      report.findings.push_back(std::move(findings_[kind]));
    }
    return report;
  }

 private:
  std::string prefix_;
  std::array<MeshReport::Finding, problemCount> findings_{};
  std::array<std::uint32_t, problemCount> lastVertex_{};
};

constexpr const char* typeNames[] = {"float32", "float16", "snorm8", "snorm16", "unorm8",
                                     "unorm16", "uint8",   "uint16", "uint32"};

struct AttributeRule {
  const char* name;
  std::uint32_t fewest, most;  ///< components
  bool (*allows)(ComponentType);
};

constexpr std::uint32_t anyNumber = 0xffffffffu;

bool isFloat32(ComponentType type) {
  return type == ComponentType::float32;
}
bool isFloat(ComponentType type) {
  return type == ComponentType::float32 || type == ComponentType::float16;
}
bool isPositionType(ComponentType type) {
  return isFloat(type) || type == ComponentType::snorm16 || type == ComponentType::unorm16;
}
bool isDirectionType(ComponentType type) {
  return isFloat(type) || type == ComponentType::snorm8 || type == ComponentType::snorm16;
}
bool isDisplacementType(ComponentType type) {
  return isFloat(type) || type == ComponentType::snorm16;
}
bool isJointType(ComponentType type) {
  return isFloat32(type) || type == ComponentType::uint8 || type == ComponentType::uint16 ||
         type == ComponentType::uint32;
}
bool isWeightType(ComponentType type) {
  return type == ComponentType::float32 || type == ComponentType::unorm8 ||
         type == ComponentType::unorm16;
}

/// "3 or 4 components of type float32 or snorm16".
std::string inWords(const AttributeRule& rule) {
  std::string words = std::to_string(rule.fewest);
  if (rule.most != rule.fewest)
    words += rule.most == anyNumber ? " or more" : " or " + std::to_string(rule.most);
  words += rule.most == 1 ? " component of type " : " components of type ";
  std::vector<const char*> names;
  for (std::size_t type = 0; type < std::size(typeNames); ++type) {
    if (rule.allows(static_cast<ComponentType>(type))) names.push_back(typeNames[type]);
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) words += i + 1 == names.size() ? " or " : ", ";
    words += names[i];
  }
  return words;
}

bool checkView(const AttributeView& view, const AttributeRule& rule, std::uint32_t count,
               const char* elements, Findings& findings) {
  const std::string name = rule.name;
  if (!rule.allows(view.type) || view.components < rule.fewest || view.components > rule.most) {
    findings.addView(MeshProblem::wrongFormat, "the " + name + " must have " + inWords(rule));
    return false;
  }
  if (view.count != count) {
    findings.addView(MeshProblem::countMismatch, "there are " + std::to_string(view.count) + " " +
                                                     name + " for " + std::to_string(count) + " " +
                                                     elements);
    return false;
  }
  const std::uint64_t size = std::uint64_t{view.components} * componentSize(view.type);
  if (view.stride < size) {
    findings.addView(MeshProblem::strideTooSmall,
                     "the stride of the " + name + " is " + std::to_string(view.stride) +
                         " bytes, but an element has " + std::to_string(size));
    return false;
  }
  return true;
}

bool checkMorphTarget(const MorphTargetView& target, std::size_t index, std::uint32_t vertexCount,
                      Findings& findings) {
  const std::string name = "morph target " + std::to_string(index);
  for (std::size_t i = 0; i < target.vertices.size(); ++i) {
    if (target.vertices[i] >= vertexCount ||
        (i > 0 && target.vertices[i] <= target.vertices[i - 1])) {
      std::string message = name + " lists vertex " + std::to_string(target.vertices[i]);
      if (target.vertices[i] >= vertexCount) {
        message += ", but the mesh has " + std::to_string(vertexCount) + " vertices";
      } else {
        message += " after vertex " + std::to_string(target.vertices[i - 1]) +
                   ", but vertices must be in ascending order";
      }
      findings.addView(MeshProblem::morphVertices, message);
      return false;
    }
  }
  const auto count =
      target.vertices.empty() ? vertexCount : static_cast<std::uint32_t>(target.vertices.size());
  bool good = true;
  for (const auto& [view, what, allows] :
       {std::tuple{&target.positions, "position", &isDisplacementType},
        {&target.normals, "normal", &isDirectionType},
        {&target.tangents, "tangent", &isDirectionType}}) {
    if (!*view) continue;
    const std::string displacements = std::string(what) + " displacements of " + name;
    good &= checkView(*view, {displacements.c_str(), 3, 4, allows}, count, "displaced vertices",
                      findings);
  }
  return good;
}

bool checkInfluenceSets(const MeshView& mesh, Findings& findings) {
  if (mesh.influenceSets.empty()) {
    findings.addView(MeshProblem::noInfluenceSets, "it has no joints and weights");
    return false;
  }
  bool good = true;
  for (const InfluenceSet& set : mesh.influenceSets) {
    if (!set.joints || !set.weights) {
      findings.addView(MeshProblem::noInfluenceSets,
                       "an influence set lacks its joints or its weights");
      return false;
    }
    good &= checkView(set.joints, {"joints", 1, anyNumber, isJointType}, mesh.vertexCount,
                      "vertices", findings);
    good &= checkView(set.weights, {"weights", 1, anyNumber, isWeightType}, mesh.vertexCount,
                      "vertices", findings);
    if (set.joints.components != set.weights.components) {
      findings.addView(MeshProblem::wrongFormat,
                       "an influence set has " + std::to_string(set.joints.components) +
                           " joints but " + std::to_string(set.weights.components) +
                           " weights per vertex");
      good = false;
    }
  }
  return good;
}

bool checkPositions(const MeshView& mesh, Findings& findings) {
  if (mesh.vertexCount == 0) {
    findings.addView(MeshProblem::emptyMesh, "it has no vertices");
    return false;
  }
  if (!mesh.positions) {
    findings.addView(MeshProblem::emptyMesh, "it has no positions");
    return false;
  }
  return checkView(mesh.positions, {"positions", 3, 4, isPositionType}, mesh.vertexCount,
                   "vertices", findings);
}

bool checkViews(const MeshView& mesh, Findings& findings) {
  bool good = checkPositions(mesh, findings);
  if (mesh.vertexCount == 0 || !mesh.positions) return false;
  const auto check = [&](const AttributeView& view, const AttributeRule& rule) {
    return !view || checkView(view, rule, mesh.vertexCount, "vertices", findings);
  };
  good &= check(mesh.normals, {"normals", 3, 4, isDirectionType});
  good &= check(mesh.tangents, {"tangents", 4, 4, isDirectionType});
  good &= check(mesh.dualQuaternionWeights, {"dual-quaternion weights", 1, 1, isWeightType});
  good &= check(mesh.bulgeStrengths, {"bulge strengths", 1, 1, isWeightType});
  good &= check(mesh.centersOfRotation, {"centers of rotation", 3, 3, isFloat32});
  for (std::size_t index = 0; index < mesh.morphTargets.size(); ++index) {
    good &= checkMorphTarget(mesh.morphTargets[index], index, mesh.vertexCount, findings);
  }
  return checkInfluenceSets(mesh, findings) && good;
}

bool isFiniteElement(const AttributeView& view, std::uint32_t element, std::uint32_t components) {
  for (std::uint32_t component = 0; component < components; ++component) {
    if (!std::isfinite(loadFloat(view, element, component))) return false;
  }
  return true;
}

bool isFinitePosition(const MeshView& mesh, std::uint32_t vertex) {
  for (std::uint32_t component = 0; component < 3; ++component) {
    if (!std::isfinite(loadPosition(mesh, vertex, component))) return false;
  }
  return true;
}

/// Returns whether there is an element and it is finite.
bool checkFinite(const AttributeView& view, std::uint32_t components, MeshProblem problem,
                 const char* name, std::uint32_t vertex, Findings& findings) {
  if (!view) return false;
  if (isFiniteElement(view, vertex, components)) return true;
  findings.addVertex(problem, vertex,
                     [&] { return std::string("the ") + name + " is not finite"; });
  return false;
}

void checkLength(const AttributeView& view, MeshProblem problem, const char* name,
                 std::uint32_t vertex, Findings& findings) {
  constexpr double tolerance = 0.00674;
  double square = 0;
  for (std::uint32_t component = 0; component < 3; ++component) {
    const double value = static_cast<double>(loadFloat(view, vertex, component));
    square += value * value;
  }
  const double length = std::sqrt(square);
  if (std::abs(length - 1) <= tolerance) return;
  findings.addVertex(problem, vertex, [&] {
    return std::string("the ") + name + " has a length of " + decimal(length) + ", not 1";
  });
}

void checkDirections(const MeshView& mesh, std::uint32_t vertex, Findings& findings) {
  if (checkFinite(mesh.normals, 3, MeshProblem::nonFiniteNormal, "normal", vertex, findings))
    checkLength(mesh.normals, MeshProblem::normalLength, "normal", vertex, findings);
  if (!checkFinite(mesh.tangents, 4, MeshProblem::nonFiniteTangent, "tangent", vertex, findings))
    return;
  checkLength(mesh.tangents, MeshProblem::tangentLength, "tangent", vertex, findings);
  const float sign = loadFloat(mesh.tangents, vertex, 3);
  if (sign == 1 || sign == -1) return;
  findings.addVertex(MeshProblem::tangentSign, vertex, [&] {
    return "the handedness of the tangent is " + decimal(static_cast<double>(sign)) +
           ", not 1 or -1";
  });
}

bool isShare(float share) {
  return share >= 0 && share <= 1;
}

/// `whole` is the mesh's own, which counts where the vertices have none.
void checkShares(const AttributeView& view, float whole, const char* name, Findings& findings) {
  if (!view && !isShare(whole)) {
    findings.addView(MeshProblem::methodWeightOutOfRange, std::string("its ") + name + " is " +
                                                              decimal(static_cast<double>(whole)) +
                                                              ", not from 0 to 1");
  }
  for (std::uint32_t vertex = 0; view && vertex < view.count; ++vertex) {
    const float share = loadFloat(view, vertex, 0);
    if (isShare(share)) continue;
    findings.addVertex(MeshProblem::methodWeightOutOfRange, vertex, [&] {
      return std::string("the ") + name + " is " + decimal(static_cast<double>(share)) +
             ", not from 0 to 1";
    });
  }
}

bool isFiniteDisplacement(const MorphTargetView& target, std::uint32_t element) {
  for (std::uint32_t component = 0; component < 3; ++component) {
    if (target.positions && !std::isfinite(loadMorphPosition(target, element, component)))
      return false;
    if (target.normals && !std::isfinite(loadFloat(target.normals, element, component)))
      return false;
    if (target.tangents && !std::isfinite(loadFloat(target.tangents, element, component)))
      return false;
  }
  return true;
}

void checkDisplacements(const MorphTargetView& target, std::size_t index, std::uint32_t vertexCount,
                        Findings& findings) {
  const auto count =
      target.vertices.empty() ? vertexCount : static_cast<std::uint32_t>(target.vertices.size());
  for (std::uint32_t element = 0; element < count; ++element) {
    if (isFiniteDisplacement(target, element)) continue;
    findings.addEach(MeshProblem::nonFiniteMorph,
                     target.vertices.empty() ? element : target.vertices[element], [&] {
                       return "its displacement by morph target " + std::to_string(index) +
                              " is not finite";
                     });
  }
}

/// What the weights of a vertex must sum to for each way of storing them.
double allowedDeviation(const MeshView& mesh, std::uint32_t usedWeights) {
  const bool anyFloat =
      std::any_of(mesh.influenceSets.begin(), mesh.influenceSets.end(),
                  [](const InfluenceSet& set) { return isFloat(set.weights.type); });
  // Integers are summed exactly in double, so that a quarter of the smallest step tells whether
  // they sum to 1.
  return anyFloat ? 2e-7 * usedWeights : 0.25 / 65535.0;
}

/// "joint 31", as the mesh stores it.
std::string jointText(const InfluenceSet& set, std::uint32_t vertex, std::uint32_t slot) {
  return "joint " + (isFloat32(set.joints.type)
                         ? decimal(loadReal(set.joints, vertex, slot))
                         : std::to_string(loadUnsigned(set.joints, vertex, slot)));
}

/// Why the pose does not have the joint.
std::string whyOutOfRange(const InfluenceSet& set, std::uint32_t vertex, std::uint32_t slot,
                          std::uint32_t jointCount) {
  const double joint = loadReal(set.joints, vertex, slot);
  return joint != std::floor(joint)
             ? " is not a whole number"
             : " is outside the pose of " + std::to_string(jointCount) + " joints";
}

void checkInfluences(const MeshView& mesh, std::uint32_t jointCount, std::uint32_t vertex,
                     std::vector<std::uint32_t>& used, Findings& findings) {
  used.clear();
  double sum = 0;
  std::uint32_t usedWeights = 0;
  bool good = true;
  for (const InfluenceSet& set : mesh.influenceSets) {
    for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
      const double weight = loadWeight(set.weights, vertex, slot);
      const std::uint32_t joint = loadJoint(set.joints, vertex, slot);
      if (weight == 0) {
        if (joint < jointCount) continue;
        findings.addVertex(MeshProblem::unusedJointOutOfRange, vertex, [&] {
          return jointText(set, vertex, slot) + ", with weight 0," +
                 whyOutOfRange(set, vertex, slot, jointCount);
        });
        continue;
      }
      if (!std::isfinite(weight)) {
        findings.addVertex(MeshProblem::nonFiniteWeight, vertex, [&] {
          return "the weight of " + jointText(set, vertex, slot) + " is not finite";
        });
        good = false;
        continue;
      }
      if (weight < 0) {
        findings.addVertex(MeshProblem::negativeWeight, vertex, [&] {
          return "the weight of " + jointText(set, vertex, slot) + " is negative";
        });
        good = false;
        continue;
      }
      if (joint >= jointCount) {
        findings.addVertex(MeshProblem::jointOutOfRange, vertex, [&] {
          return jointText(set, vertex, slot) + whyOutOfRange(set, vertex, slot, jointCount);
        });
        good = false;
        continue;
      }
      sum += weight / wholeWeight;
      ++usedWeights;
      used.push_back(joint);
    }
  }
  if (usedWeights == 0) {
    findings.addVertex(MeshProblem::vertexWithoutWeight, vertex, [] {
      return std::string("no joint has a weight; the vertex stays in bind pose");
    });
    return;
  }
  if (good && std::abs(sum - 1) > allowedDeviation(mesh, usedWeights)) {
    findings.addVertex(MeshProblem::weightsNotNormalized, vertex,
                       [&] { return "the weights sum to " + decimal(sum) + ", not to 1"; });
  }
  std::sort(used.begin(), used.end());
  const auto twice = std::adjacent_find(used.begin(), used.end());
  if (twice != used.end()) {
    findings.addVertex(MeshProblem::duplicateJoint, vertex,
                       [&] { return "joint " + std::to_string(*twice) + " occurs twice"; });
  }
}

}  // namespace

bool refusedByPack(MeshProblem problem) {
  return problem <= MeshProblem::jointOutOfRange;
}

const char* meshProblemName(MeshProblem problem) {
  constexpr const char* names[] = {"empty mesh",
                                   "no joints and weights",
                                   "counts differ",
                                   "stride too small",
                                   "wrong format",
                                   "wrong vertices of a morph target",
                                   "position not finite",
                                   "normal not finite",
                                   "tangent not finite",
                                   "displacement not finite",
                                   "center of rotation not finite",
                                   "dual-quaternion weight or bulge strength out of range",
                                   "weight not finite",
                                   "negative weight",
                                   "joint out of range",
                                   "weights do not sum to 1",
                                   "joint twice in a vertex",
                                   "vertex without weight",
                                   "joint out of range, with weight 0",
                                   "normal not of unit length",
                                   "tangent not of unit length",
                                   "tangent without handedness"};
  static_assert(std::size(names) == std::size_t(MeshProblem::tangentSign) + 1);
  return nameIn(names, problem);
}

bool MeshReport::packable() const {
  return std::none_of(findings.begin(), findings.end(),
                      [](const Finding& finding) { return refusedByPack(finding.problem); });
}

Result<void> MeshReport::accepted() const {
  const auto refused = std::ranges::find_if(
      findings, [](const Finding& finding) { return refusedByPack(finding.problem); });
  if (refused == findings.end()) return {};
  return Error{ErrorCode::invalidMesh,
               refused->message + (repairable() ? "; repair() can fix it" : "")};
}

bool MeshReport::repairable() const {
  return std::none_of(findings.begin(), findings.end(), [](const Finding& finding) {
    return finding.problem <= MeshProblem::morphVertices;
  });
}

const MeshReport::Finding* MeshReport::find(MeshProblem problem) const {
  for (const Finding& finding : findings) {
    if (finding.problem == problem) return &finding;
  }
  return nullptr;
}

Result<void> checkPositions(const MeshView& mesh) {
  Findings findings(mesh.name);
  checkPositions(mesh, findings);
  return findings.take().accepted();
}

Result<void> checkPackable(const MeshView& mesh, std::uint32_t jointCount) {
  if (jointCount == 0 || jointCount > maxPoseJoints) {
    return Error{ErrorCode::invalidArgument, "mesh " + inQuotes(mesh.name) + ": a pose has 1 to " +
                                                 std::to_string(maxPoseJoints) + " joints, not " +
                                                 std::to_string(jointCount)};
  }
  return validate(mesh, jointCount).accepted();
}

MeshReport validate(const MeshView& mesh, std::uint32_t jointCount) {
  Findings findings(mesh.name);
  if (!checkViews(mesh, findings)) return findings.take();

  const std::uint32_t joints = std::min(jointCount, maxPoseJoints);
  std::vector<std::uint32_t> used;
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    if (!isFinitePosition(mesh, vertex)) {
      findings.addVertex(MeshProblem::nonFinitePosition, vertex,
                         [] { return std::string("the position is not finite"); });
    }
    checkDirections(mesh, vertex, findings);
    checkFinite(mesh.centersOfRotation, 3, MeshProblem::nonFiniteCenter, "center of rotation",
                vertex, findings);
    checkInfluences(mesh, joints, vertex, used, findings);
  }
  checkShares(mesh.dualQuaternionWeights, mesh.dualQuaternionWeight, "dual-quaternion weight",
              findings);
  checkShares(mesh.bulgeStrengths, mesh.bulgeStrength, "bulge strength", findings);
  for (std::size_t index = 0; index < mesh.morphTargets.size(); ++index) {
    checkDisplacements(mesh.morphTargets[index], index, mesh.vertexCount, findings);
  }
  return findings.take();
}

}  // namespace dermis
