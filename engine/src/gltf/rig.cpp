// Reads rigs.
#include "gltf/rig.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "core/affine.h"
#include "gltf/descendants.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/properties.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

/// Joints of glTF have 16 bits. The last number stands for joints that do not exist.
constexpr std::size_t mostJoints = 65535;

template <std::size_t count>
std::array<float, count> readNumbers(const json& value, const std::string& what) {
  if (!value.is_array() || value.size() != count)
    failInvalid(what, " is not an array of ", count, " numbers");
  std::array<float, count> numbers{};
  for (std::size_t i = 0; i < count; ++i) {
    if (!value[i].is_number()) failInvalid(what, " is not an array of ", count, " numbers");
    const double number = value[i].get<double>();
    if (!(std::abs(number) <= static_cast<double>(std::numeric_limits<float>::max())))
      failInvalid(what, " has a number that is out of range for float32");
    numbers[i] = static_cast<float>(number);
  }
  return numbers;
}

/// Numbers of which one is not 0.
template <std::size_t count>
std::array<float, count> readDirection(const json& value, const std::string& what) {
  const std::array<float, count> numbers = readNumbers<count>(value, what);
  if (std::ranges::all_of(numbers, [](float number) { return number == 0; }))
    failInvalid(what, " is 0");
  return numbers;
}

float readFloat(const json& object, const char* property, const std::string& where, float absent) {
  number(object, property, where);
  return object.contains(property) ? object.at(property).get<float>() : absent;
}

/// Fails if a member has another name.
void allow(const json& object, const std::set<std::string_view>& names, const std::string& where) {
  if (!object.is_object()) failInvalid(where, " is not an object");
  for (const auto& member : object.items()) {
    if (names.contains(member.key())) continue;
    std::string all;
    for (const std::string_view name : names) all += (all.empty() ? "" : ", ") + std::string(name);
    failInvalid(where, ": the member ", inQuotes(member.key()), " is unknown; known are ", all);
  }
}

/// A name, or a number as text.
std::string readName(json& value, const std::string& what) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_number()) failInvalid(what, " is neither a name nor a number");
  return textOf(integer(value, what));
}

std::uint32_t numberFrom(const std::string& name) {
  std::uint32_t number = noIndex;
  const char* const end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data(), end, number);
  return error == std::errc() && stop == end ? number : noIndex;
}

/// How the text names a morph target.
struct TargetName {
  std::string name;
  std::uint32_t number = noIndex;  ///< the name as a number
};

/// "mesh 'arm'"; without a name "mesh 2".
std::string titleOf(const Model& model, std::uint32_t mesh) {
  const std::string& name = model.meshes[mesh].name;
  return "mesh " + (name.empty() ? textOf(mesh) : inQuotes(name));
}

/// The morph targets of a mesh.
class TargetFinder {
 public:
  TargetFinder(const Model& model, std::uint32_t index, MemoryBudget& budget)
      : model_(model), index_(index), count_(model.meshes[index].morphTargetCount) {
    spend(budget, count_, 96, "the morph targets of a rig");
    const std::vector<std::string>& names = model.meshes[index].morphTargetNames;
    for (std::uint32_t i = 0; i < std::min<std::size_t>(names.size(), count_); ++i) {
      const auto [known, isNew] = byName_.emplace(names[i], i);
      if (!isNew) known->second = noIndex;
    }
  }

  /// The target that has this name; if there is none, with this number. Otherwise `none`. Fails if
  /// several have the name.
  std::uint32_t find(const TargetName& target) const {
    const auto found = target.name.empty() ? byName_.end() : byName_.find(target.name);
    if (found == byName_.end()) return target.number < count_ ? target.number : noIndex;
    if (found->second == noIndex)
      failInvalid("several morph targets of ", titleOf(model_, index_), " are called ",
                  inQuotes(target.name), "; write the number of one");
    return found->second;
  }

 private:
  const Model& model_;
  std::uint32_t index_, count_;
  std::map<std::string_view, std::uint32_t> byName_;  ///< `none`: several
};

/// The inverse, or zeros if there is none; `packRig` refuses a driver that reads that.
JointMatrix inverseOrZero(const JointMatrix& matrix) {
  Affine<double> numbers;
  for (std::size_t row = 0; row < 3; ++row) std::ranges::copy(matrix.m[row], numbers[row].begin());
  const std::optional<Affine<double>> found = inverseOf(numbers);
  constexpr JointMatrix zero{.m = {}};
  if (!found) return zero;
  JointMatrix inverse;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      inverse.m[row][column] = static_cast<float>((*found)[row][column]);
      if (!std::isfinite(inverse.m[row][column])) return zero;
    }
  }
  return inverse;
}

class RigReader {
 public:
  RigReader(const Model& model, std::uint32_t skin, MemoryBudget& budget, OwnedRig& rig)
      : model_(model),
        skin_(model.skins[skin]),
        number_(skin),
        budget_(budget),
        rig_(rig),
        descendants_(model) {
    spend(budget_, skin_.joints.size(), 256, "the joints of a rig");
    spend(budget_, model_.nodes.size(), 4 * sizeof(std::uint32_t), "the joints of a rig");
    for (std::uint32_t i = 0; i < skin_.joints.size(); ++i) {
      const auto [known, isNew] = names_.emplace(model_.nodes[skin_.joints[i]].name, i);
      if (!isNew) known->second = noIndex;
    }
  }

  void read(std::string_view text) {
    json root = parseText(text, budget_);
    allow(root, {"drivers"}, "the rig");
    json& drivers = requireArray(root, "drivers", "the rig");
    for (driver_ = 0; driver_ < drivers.size(); ++driver_) {
      where_ = join("driver ", driver_);
      readDriver(drivers[driver_]);
    }
    addJoints();
    findWeights();
    RigView& view = rig_.view;
    view.joints = rig_.joints;
    view.twists = rig_.twists;
    view.correctives = rig_.correctives;
    view.chains = rig_.chains;
    view.linears = rig_.linears;
    if (const Result<PackedRig> packed = packRig(view); !packed)
      fail(packed.error().code == ErrorCode::limitExceeded ? ErrorCode::limitExceeded
                                                           : ErrorCode::invalidData,
           inTermsOfTheText(packed.error().message));
  }

 private:
  std::string in(const char* member) const { return join(where_, ": ", member); }

  std::uint32_t jointOf(json& value, const std::string& what) const {
    const std::string name = readName(value, what);
    const auto found = names_.find(name);
    if (found != names_.end() && found->second == noIndex && !name.empty())
      failInvalid(what, ": several joints of the skin are called ", inQuotes(name),
                  "; write the number of one");
    const std::uint32_t joint =
        found != names_.end() && !name.empty() ? found->second : numberFrom(name);
    if (joint >= skin_.joints.size()) failInvalid(what, ": the skin has no joint ", inQuotes(name));
    return joint;
  }

  std::vector<std::uint32_t> jointsOf(json& list, const std::string& what) const {
    if (!list.is_array()) failInvalid(what, " is not an array of joints");
    std::vector<std::uint32_t> joints;
    for (json& value : list) joints.push_back(jointOf(value, what));
    return joints;
  }

  std::uint32_t drive(std::uint32_t joint) {
    const auto [other, isNew] = drivenJoints_.emplace(joint, driver_);
    if (!isNew)
      failInvalid(where_, ": driver ", other->second, " drives the joint ", nameOf(joint), ", too");
    return joint;
  }

  std::string nameOf(std::uint32_t joint) const {
    return inQuotes(model_.nodes[skin_.joints[joint]].name);
  }

  void readDriver(json& driver) {
    if (!driver.is_object()) failInvalid(where_, " is not an object");
    if (driver.contains("twist")) return readTwist(driver);
    if (driver.contains("corrective")) return readCorrective(driver);
    if (driver.contains("chain")) return readChain(driver);
    if (driver.contains("linear")) return readLinear(driver);
    const std::set<std::string_view> known{"axis",  "examples", "radius", "segments",
                                           "share", "source",   "terms"};
    std::string found;
    for (const auto& member : driver.items())
      if (found.empty() && !known.contains(member.key())) found = ", but " + inQuotes(member.key());
    failInvalid(where_, ": it has none of twist, corrective, chain, linear", found);
  }

  void readTwist(json& driver) {
    allow(driver, {"twist", "source", "axis", "share"}, where_);
    TwistDriver& twist = rig_.twists.emplace_back();
    numbers_[0].push_back(driver_);
    twist.joint = drive(jointOf(driver["twist"], in("twist")));
    require(driver, "source", where_);
    twist.source = jointOf(driver["source"], in("source"));
    twist.axis = readDirection<3>(require(driver, "axis", where_), in("axis"));
    twist.share = readFloat(driver, "share", where_, twist.share);
    if (!(std::abs(twist.share) <= 1))
      failInvalid(in("share"), " is ", double{twist.share}, ", which is not from -1 to 1");
  }

  void readCorrective(json& driver) {
    allow(driver, {"corrective", "radius", "examples"}, where_);
    CorrectiveDriver& corrective = rig_.correctives.emplace_back();
    numbers_[1].push_back(driver_);
    rig_.jointLists.push_back(jointsOf(driver["corrective"], in("corrective")));
    corrective.inputs = rig_.jointLists.back();
    if (corrective.inputs.empty()) failInvalid(in("corrective"), " lists no joint");
    corrective.radius = readFloat(driver, "radius", where_, corrective.radius);
    if (!(corrective.radius >= 0))
      failInvalid(in("radius"), " is ", double{corrective.radius}, ", which is negative");
    if (corrective.radius == 0 && driver.contains("radius") && driver["radius"] != 0)
      failInvalid(in("radius"), " is ", driver["radius"].get<double>(),
                  ", which is too small for float32");
    json& examples = requireArray(driver, "examples", where_);
    if (examples.empty() || examples.size() > maxRigExamples)
      fail(examples.empty() ? ErrorCode::invalidData : ErrorCode::limitExceeded,
           join(where_, ": there are ", examples.size(), " examples; 1 to ", maxRigExamples,
                " are allowed"));

    // What they name, each once.
    std::map<std::string, std::size_t> weights;
    std::map<std::uint32_t, std::size_t> joints;
    std::vector<std::array<float, 4>>& rotations = rig_.rotations.emplace_back();
    for (std::size_t i = 0; i < examples.size(); ++i) {
      const std::string where = join(where_, ": example ", i);
      json& example = examples[i];
      allow(example, {"rotations", "weights", "joints"}, where);
      const json& list = requireArray(example, "rotations", where);
      if (list.size() != corrective.inputs.size())
        failInvalid(where, ": there are ", list.size(), " rotations for ",
                    counted(corrective.inputs.size(), "joint"));
      for (std::size_t input = 0; input < list.size(); ++input)
        rotations.push_back(readDirection<4>(list[input], join(where, ": rotations[", input, "]")));
      if (example.contains("weights")) {
        for (const auto& weight : requireObject(example, "weights", where).items())
          weights.emplace(weight.key(), weights.size());
      }
      if (example.contains("joints")) {
        std::map<std::uint32_t, std::string> named;
        for (const auto& joint : requireObject(example, "joints", where).items()) {
          json name = joint.key();
          const std::uint32_t number = jointOf(name, join(where, ": joints"));
          joints.emplace(number, joints.size());
          const auto [other, isNew] = named.emplace(number, joint.key());
          if (!isNew)
            failInvalid(where, ": joints: ", inQuotes(other->second), " and ",
                        inQuotes(joint.key()), " are the same joint; write one of them");
        }
      }
    }
    corrective.examples = rotations;
    spend(budget_, examples.size() * weights.size(), sizeof(float), "the examples of a rig");
    spend(budget_, examples.size() * joints.size(), sizeof(JointOffset), "the examples of a rig");

    std::vector<float>& values = rig_.weights.emplace_back(examples.size() * weights.size());
    std::vector<JointOffset>& offsets = rig_.offsets.emplace_back(examples.size() * joints.size());
    for (std::size_t i = 0; i < examples.size(); ++i) {
      const std::string where = join(where_, ": example ", i);
      json& example = examples[i];
      for (auto& weight : example["weights"].items()) {
        const std::string what = join(where, ": the weight ", inQuotes(weight.key()));
        if (!weight.value().is_number()) failInvalid(what, " is not a number");
        values[i * weights.size() + weights.at(weight.key())] =
            readNumbers<1>(json::array({weight.value()}), what)[0];
      }
      for (auto& joint : example["joints"].items()) {
        json name = joint.key();
        offsets[i * joints.size() + joints.at(jointOf(name, where))] =
            readOffset(joint.value(), join(where, ": joint ", inQuotes(joint.key())));
      }
    }
    corrective.firstWeight = static_cast<std::uint32_t>(driven_.size());
    corrective.weightCount = static_cast<std::uint32_t>(weights.size());
    corrective.weights = values;
    corrective.offsets = offsets;
    driven_.resize(driven_.size() + weights.size());
    for (const auto& [name, place] : weights) {
      const std::uint32_t number = corrective.firstWeight + static_cast<std::uint32_t>(place);
      const auto [other, isNew] = drivenWeights_.emplace(name, std::pair(number, driver_));
      if (!isNew)
        failInvalid(where_, ": driver ", other->second.second, " drives the weight ",
                    inQuotes(name), ", too");
      driven_[number] = {name, numberFrom(name)};
    }
    std::vector<std::uint32_t>& driven = rig_.jointLists.emplace_back(joints.size());
    for (const auto& [joint, place] : joints) driven[place] = drive(joint);
    corrective.joints = driven;
  }

  static JointOffset readOffset(const json& value, const std::string& where) {
    allow(value, {"translation", "rotation", "scale"}, where);
    JointOffset offset;
    if (value.contains("translation"))
      offset.translation = readNumbers<3>(value.at("translation"), where + ": translation");
    if (value.contains("rotation"))
      offset.rotation = readDirection<4>(value.at("rotation"), where + ": rotation");
    if (value.contains("scale"))
      offset.scale = readNumbers<3>(value.at("scale"), where + ": scale");
    return offset;
  }

  void readChain(json& driver) {
    allow(driver, {"chain", "segments"}, where_);
    ChainDriver& chain = rig_.chains.emplace_back();
    numbers_[2].push_back(driver_);
    rig_.jointLists.push_back(jointsOf(driver["chain"], in("chain")));
    chain.joints = rig_.jointLists.back();
    if (chain.joints.size() < 2) failInvalid(in("chain"), " lists less than two joints");
    for (std::size_t i = 1; i < chain.joints.size(); ++i) {
      const std::uint32_t joint = chain.joints[i], before = chain.joints[i - 1];
      if (joint == before) failInvalid(in("chain"), " lists the joint ", nameOf(joint), " twice");
      if (descendants_.isOrIsBelow(skin_.joints[before], skin_.joints[joint]))
        failInvalid(in("chain"), ": the joint ", nameOf(joint), " is above ", nameOf(before),
                    "; list joints from the root to the tip");
    }
    const std::uint64_t segments = requireInteger(driver, "segments", where_);
    if (segments < 2 || segments > mostJoints)
      failInvalid(in("segments"), " is ", segments, ", which is not from 2 to ", mostJoints);
    chain.segments = static_cast<std::uint32_t>(segments);
    ofChains_ += segments - 1;
  }

  void readLinear(json& driver) {
    allow(driver, {"linear", "terms"}, where_);
    LinearDriver& linear = rig_.linears.emplace_back();
    numbers_[3].push_back(driver_);
    linear.joint = drive(jointOf(driver["linear"], in("linear")));
    json& terms = requireArray(driver, "terms", where_);
    std::vector<JointMatrix>& matrices = rig_.matrices.emplace_back();
    std::vector<std::string>& names = termNames_.emplace_back();
    for (std::size_t i = 0; i < terms.size(); ++i) {
      const std::string where = join(where_, ": term ", i);
      allow(terms[i], {"weight", "matrix"}, where);
      require(terms[i], "weight", where);
      names.push_back(readName(terms[i]["weight"], where + ": weight"));
      const auto rows = readNumbers<12>(require(terms[i], "matrix", where), where + ": matrix");
      JointMatrix& matrix = matrices.emplace_back();
      for (std::size_t row = 0; row < 3; ++row)
        std::copy_n(rows.begin() + static_cast<std::ptrdiff_t>(row * 4), 4, matrix.m[row]);
    }
    linear.matrices = matrices;
  }

  /// Numbers the joints: written ones, driven ones of the skin, those of chains.
  void addJoints() {
    const std::size_t count = skin_.joints.size();
    if (count + ofChains_ > mostJoints)
      fail(ErrorCode::limitExceeded,
           join("the rig has ", count + ofChains_, " joints; the maximum is ", mostJoints));
    spend(budget_, ofChains_, 4 * sizeof(RigJoint), "the joints of a rig");
    rig_.view.writtenJoints = static_cast<std::uint32_t>(count - drivenJoints_.size());
    if (rig_.view.writtenJoints == 0) failInvalid("the rig drives all joints of the skin");
    std::uint32_t written = 0, driven = rig_.view.writtenJoints;
    for (std::uint32_t joint = 0; joint < count; ++joint)
      rig_.places.push_back(drivenJoints_.contains(joint) ? driven++ : written++);

    // The nearest joint above each node.
    std::vector<std::uint32_t> jointOfNode(model_.nodes.size(), noIndex);
    for (std::uint32_t joint = 0; joint < count; ++joint)
      jointOfNode[skin_.joints[joint]] = rig_.places[joint];
    std::vector<std::uint32_t> above(model_.nodes.size(), noIndex);
    for (const std::uint32_t node : model_.nodeOrder) {
      const std::uint32_t parent = model_.nodes[node].parent;
      if (parent != noIndex)
        above[node] = jointOfNode[parent] != noIndex ? jointOfNode[parent] : above[parent];
    }
    rig_.joints.resize(static_cast<std::size_t>(count + ofChains_));
    for (std::uint32_t joint = 0; joint < count; ++joint)
      rig_.joints[rig_.places[joint]] = {above[skin_.joints[joint]],
                                         inverseOrZero(skin_.inverseBindMatrices[joint])};

    noteChildren(above);
    for (std::vector<std::uint32_t>& list : rig_.jointLists)
      for (std::uint32_t& joint : list) joint = rig_.places[joint];
    for (TwistDriver& twist : rig_.twists) {
      twist.joint = rig_.places[twist.joint];
      twist.source = rig_.places[twist.source];
    }
    for (LinearDriver& linear : rig_.linears) linear.joint = rig_.places[linear.joint];
    auto next = static_cast<std::uint32_t>(count);
    for (ChainDriver& chain : rig_.chains) {
      chain.firstDriven = next;
      next += chain.segments - 1;
    }
  }

  /// Notes written joints below driven ones. `above`: by node, the joint of the rig above it.
  void noteChildren(const std::vector<std::uint32_t>& above) {
    std::map<std::uint32_t, std::vector<std::uint32_t>> below;  // by driven joint
    for (std::uint32_t joint = 0; joint < skin_.joints.size(); ++joint) {
      if (const std::uint32_t parent = above[skin_.joints[joint]];
          parent != noIndex && !drivenJoints_.contains(joint))
        below[parent].push_back(joint);
    }
    for (const auto& [joint, driver] : drivenJoints_) {
      const auto found = below.find(rig_.places[joint]);
      if (found == below.end()) continue;
      const std::size_t others = found->second.size() - 1;
      rig_.notes.push_back(join("the rig of skin ", number_, ": ", nameOf(found->second[0]),
                                others == 0 ? "" : join(" and ", counted(others, "other joint")),
                                " below the driven joint ", nameOf(joint), " follow",
                                others == 0 ? "s" : "", " the node, not the driver"));
    }
  }

  /// Fails if two driven weights are one target of the mesh: both would displace it. `targets`: by
  /// driven weight.
  void checkDriven(std::uint32_t mesh, const std::vector<std::uint32_t>& targets) const {
    std::map<std::uint32_t, std::size_t> known;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      if (targets[i] == noIndex) continue;
      const auto [other, isNew] = known.emplace(targets[i], i);
      if (!isNew)
        failInvalid("driver ", drivenWeights_.at(driven_[i].name).second, ": the weights ",
                    inQuotes(driven_[other->second].name), " and ", inQuotes(driven_[i].name),
                    " are the same morph target of ", titleOf(model_, mesh), "; write one of them");
    }
  }

  void findWeights() {
    std::set<std::string> given, read;
    for (const std::vector<std::string>& names : termNames_) {
      for (const std::string& name : names)
        (drivenWeights_.contains(name) ? read : given).insert(name);
    }
    std::vector<TargetName> givenNames;
    for (const std::string& name : given) givenNames.push_back({name, numberFrom(name)});
    std::vector<std::uint32_t> givenTargets;  // of the mesh that has them all
    std::vector<bool> isTarget(driven_.size());
    std::set<std::uint32_t> meshes;
    for (std::uint32_t i = 0; i < model_.nodes.size(); ++i) {
      const Node& node = model_.nodes[i];
      if (node.skin != number_ || !meshes.insert(node.mesh).second) continue;
      if (model_.meshes[node.mesh].morphTargetCount == 0) continue;
      // Looking names up takes more time than memory.
      spend(budget_, given.size() + driven_.size(), 32, "the morph targets of a rig");
      const TargetFinder known(model_, node.mesh, budget_);
      std::vector<std::uint32_t> targets;
      for (const TargetName& name : driven_) targets.push_back(known.find(name));
      checkDriven(node.mesh, targets);
      bool hasSome = false;
      for (std::size_t weight = 0; weight < targets.size(); ++weight) {
        if (targets[weight] == noIndex) continue;
        isTarget[weight] = true;
        hasSome = true;
      }
      if (hasSome) rig_.targets.emplace(node.mesh, std::move(targets));
      if (rig_.view.weightsOf != noIndex || given.empty()) continue;
      givenTargets.clear();
      const bool hasAll = std::ranges::all_of(givenNames, [&](const TargetName& name) {
        return givenTargets.emplace_back(known.find(name)) != noIndex;
      });
      if (hasAll) rig_.view.weightsOf = i;
    }
    if (!given.empty() && rig_.view.weightsOf == noIndex)
      failInvalid("the rig: no mesh of the skin has the morph target ", inQuotes(*given.begin()),
                  given.size() == 1 ? "" : " and the others that linear drivers read");
    for (const auto& [name, driven] : drivenWeights_) {
      if (!isTarget[driven.first] && !read.contains(name))
        failInvalid("driver ", driven.second, ": no mesh of the skin has the morph target ",
                    inQuotes(name));
    }
    // Given ones are all targets of the mesh that no driver drives.
    std::map<std::string, std::uint32_t> givenNumbers;
    if (rig_.view.weightsOf != noIndex) {
      const std::uint32_t index = model_.nodes[rig_.view.weightsOf].mesh;
      std::set<std::uint32_t> driven;
      if (const auto found = rig_.targets.find(index); found != rig_.targets.end())
        driven.insert(found->second.begin(), found->second.end());
      std::map<std::uint32_t, std::uint32_t> numbers;
      for (std::uint32_t target = 0; target < model_.meshes[index].morphTargetCount; ++target)
        if (!driven.contains(target)) numbers.emplace(target, rig_.view.givenWeights++);
      for (std::size_t i = 0; i < givenNames.size(); ++i) {
        const auto number = numbers.find(givenTargets[i]);
        if (number == numbers.end())
          failInvalid("the rig: the morph target ", inQuotes(givenNames[i].name),
                      " is also driven, by its name or its number; write one of them");
        givenNumbers.emplace(givenNames[i].name, number->second);
      }
    }
    rig_.view.drivenWeights = static_cast<std::uint32_t>(driven_.size());
    for (CorrectiveDriver& corrective : rig_.correctives)
      corrective.firstWeight += rig_.view.givenWeights;
    for (std::size_t i = 0; i < termNames_.size(); ++i) {
      std::vector<std::uint32_t>& list = rig_.weightLists.emplace_back();
      for (const std::string& name : termNames_[i]) {
        const auto driven = drivenWeights_.find(name);
        list.push_back(driven != drivenWeights_.end()
                           ? rig_.view.givenWeights + driven->second.first
                           : givenNumbers.at(name));
      }
      rig_.linears[i].weights = list;
    }
  }

  /// A message of `packRig`, with drivers as the text numbers them and names of joints.
  std::string inTermsOfTheText(std::string message) const {
    if (message.starts_with("packRig: ")) message.erase(0, 9);
    const auto replace = [&](const std::string& word, const auto& other) {
      for (std::size_t at = 0; (at = message.find(word + " ", at)) != message.npos;) {
        const std::size_t begin = at + word.size() + 1;
        const std::size_t end =
            std::min(message.find_first_not_of("0123456789", begin), message.size());
        const std::uint32_t number = numberFrom(message.substr(begin, end - begin));
        const std::string text = number == noIndex ? std::string() : other(number);
        if (!text.empty()) message.replace(at, end - at, text);
        at += std::max<std::size_t>(text.size(), 1);
      }
    };
    constexpr const char* kinds[] = {"twist", "corrective", "chain", "linear driver"};
    for (std::size_t kind = 0; kind < 4; ++kind) {
      replace(kinds[kind], [&](std::uint32_t number) {
        return number < numbers_[kind].size() ? join("driver ", numbers_[kind][number])
                                              : std::string();
      });
    }
    replace("joint", [&](std::uint32_t joint) {
      const auto place = std::ranges::find(rig_.places, joint);
      if (place == rig_.places.end()) return std::string();
      const auto index = static_cast<std::size_t>(place - rig_.places.begin());
      const std::string& name = model_.nodes[skin_.joints[index]].name;
      return name.empty() ? join("number ", index) : join("the joint ", inQuotes(name));
    });
    return message;
  }

  const Model& model_;
  const Skin& skin_;
  std::uint32_t number_;
  MemoryBudget& budget_;
  OwnedRig& rig_;
  Descendants descendants_;
  std::map<std::string, std::uint32_t> names_;  ///< joints of the skin; `none`: several
  std::size_t driver_ = 0;
  std::string where_;
  std::map<std::uint32_t, std::size_t> drivenJoints_;                           ///< and the driver
  std::map<std::string, std::pair<std::uint32_t, std::size_t>> drivenWeights_;  ///< and the driver
  std::vector<TargetName> driven_;                                              ///< weights
  std::vector<std::vector<std::string>> termNames_;  ///< by linear driver
  std::array<std::vector<std::size_t>, 4> numbers_;  ///< by kind: numbers of drivers in the text
  std::uint64_t ofChains_ = 0;
};

}  // namespace

void readRig(const Model& model, std::uint32_t skin, std::string_view text, MemoryBudget& budget,
             OwnedRig& rig) {
  RigReader(model, skin, budget, rig).read(text);
}

}  // namespace dermis::gltf
