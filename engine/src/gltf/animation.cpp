#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <utility>

#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

constexpr Format float32{TINYGLTF_COMPONENT_TYPE_FLOAT, false};
constexpr Format timeFormats[] = {float32};
constexpr Format vectorFormats[] = {float32};
// Not allowed, but with only one meaning.
constexpr Format clearVectors[] = {
    {TINYGLTF_COMPONENT_TYPE_BYTE, true},   {TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, true},
    {TINYGLTF_COMPONENT_TYPE_SHORT, true},  {TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, true},
    {TINYGLTF_COMPONENT_TYPE_BYTE, false},  {TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, false},
    {TINYGLTF_COMPONENT_TYPE_SHORT, false}, {TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, false}};
constexpr Format rotationFormats[] = {float32,
                                      {TINYGLTF_COMPONENT_TYPE_BYTE, true},
                                      {TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, true},
                                      {TINYGLTF_COMPONENT_TYPE_SHORT, true},
                                      {TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, true}};

std::optional<ChannelPath> pathOf(std::string_view name) {
  if (name == "translation") return ChannelPath::translation;
  if (name == "rotation") return ChannelPath::rotation;
  if (name == "scale") return ChannelPath::scale;
  if (name == "weights") return ChannelPath::weights;
  return std::nullopt;
}

Interpolation interpolationOf(const std::string& name) {
  if (name == "STEP") return Interpolation::step;
  if (name == "CUBICSPLINE") return Interpolation::cubicSpline;
  return Interpolation::linear;
}

// Returns 0 if a channel has no effect because there are no weights to animate.
std::uint32_t componentsOf(const Source& source, const Channel& channel, const std::string& where) {
  switch (channel.path) {
    case ChannelPath::translation:
    case ChannelPath::scale:
      return 3;
    case ChannelPath::rotation:
      return 4;
    case ChannelPath::weights:
      break;
  }
  const int mesh = source.content().nodes[channel.node].mesh;
  if (mesh < 0) {
    source.notes().broken(NoteKind::channel, where, ": node ", channel.node,
                          " has no mesh, so there are no weights to animate");
    return 0;
  }
  const auto count = morphTargetCount(source.content().meshes[static_cast<std::size_t>(mesh)]);
  if (count == 0) {
    source.notes().broken(NoteKind::channel, where, ": mesh ", mesh, " of node ", channel.node,
                          " has no morph targets");
  }
  return count;
}

// Equal times are a jump, and negative times are before the beginning. Programs disagree about the
// meaning of descending times.
void checkTimes(const std::vector<float>& times, int accessor, const std::string& where,
                Notes& notes) {
  for (std::size_t i = 0; i < times.size(); ++i) {
    const float before = i > 0 ? times[i - 1] : times[i];
    if (times[i] >= 0 && std::isfinite(times[i]) && (i == 0 || times[i] > before)) continue;
    const std::string key =
        join(where, ": key ", i, " of accessor ", accessor, " is at ", times[i]);
    if (!std::isfinite(times[i])) failInvalid(key, ", which is not finite");
    if (times[i] < before) failInvalid(key, " seconds after ", before, ": times must ascend");
    if (times[i] < 0) notes.broken(NoteKind::keys, key, " seconds, which is negative");
    if (i > 0 && times[i] == before)
      notes.broken(NoteKind::keys, key, " seconds after ", before, ": times must ascend");
  }
}

std::vector<float> readTimes(Source& source, int accessor, const std::string& where) {
  const std::string place = where + " input";
  source.require(accessor, TINYGLTF_TYPE_SCALAR, timeFormats, place);
  source.noteStride(accessor, place);
  std::vector<float> times = source.floats(accessor);
  checkTimes(times, accessor, place, source.notes());
  return times;
}

std::vector<float> readValues(Source& source, int accessor, const Channel& channel,
                              const std::string& where) {
  const std::string place = where + " output";
  switch (channel.path) {
    case ChannelPath::translation:
    case ChannelPath::scale:
      source.require(accessor, TINYGLTF_TYPE_VEC3, vectorFormats, place, clearVectors);
      break;
    case ChannelPath::rotation:
      source.require(accessor, TINYGLTF_TYPE_VEC4, rotationFormats, place);
      break;
    case ChannelPath::weights:
      source.require(accessor, TINYGLTF_TYPE_SCALAR, rotationFormats, place);
      break;
  }
  source.noteStride(accessor, place);
  const std::uint64_t perKey = channel.interpolation == Interpolation::cubicSpline ? 3 : 1;
  const std::uint64_t perElement = channel.path == ChannelPath::weights ? channel.components : 1;
  const std::uint64_t wanted = channel.times.size() * perKey * perElement;
  if (source.count(accessor) != wanted) {
    failInvalid(place, ": accessor ", accessor, " has ", source.count(accessor),
                " elements, but there must be ", wanted, " for ", channel.times.size(), " keys");
  }
  std::vector<float> values = source.floats(accessor);
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad != values.end()) {
    const auto element =
        static_cast<std::size_t>(bad - values.begin()) / source.components(accessor);
    failInvalid(place, ": element ", element, " of accessor ", accessor, " is not finite");
  }
  return values;
}

void normalizeRotations(Channel& channel, const std::string& where, Notes& notes) {
  const bool spline = channel.interpolation == Interpolation::cubicSpline;
  const std::size_t stride = spline ? 12 : 4;
  for (std::size_t offset = spline ? 4 : 0; offset < channel.values.size(); offset += stride) {
    std::array<double, 4> key;
    std::copy_n(channel.values.begin() + static_cast<std::ptrdiff_t>(offset), 4, key.begin());
    const double length = normalizeQuaternion(key);
    for (std::size_t i = 0; i < 4; ++i) channel.values[offset + i] = static_cast<float>(key[i]);
    if (isUnitLength(length)) continue;
    notes.broken(NoteKind::keyLength, where, " output: the rotation of key ", offset / stride,
                 " has a length of ", length, ", not 1");
  }
}

// Returns nothing if the channel is left out.
std::optional<Channel> readChannel(Source& source, const tinygltf::Animation& animation,
                                   const tinygltf::AnimationChannel& from, const std::string& where,
                                   std::size_t& unknownPaths) {
  const std::optional<ChannelPath> path = pathOf(from.target_path);
  if (!path) {
    ++unknownPaths;
    return std::nullopt;
  }
  const tinygltf::AnimationSampler& sampler =
      animation.samplers[static_cast<std::size_t>(from.sampler)];
  Channel channel;
  channel.node = indexOf(from.target_node);
  channel.path = *path;
  channel.interpolation = interpolationOf(sampler.interpolation);
  channel.components = componentsOf(source, channel, where);
  if (channel.components == 0) return std::nullopt;
  if (source.hasNoData(sampler.input) && source.count(sampler.input) > 1) {
    source.notes().remark(NoteKind::noTimes, where, ": its times, accessor ", sampler.input,
                          ", have no data; it is left out");
    return std::nullopt;
  }
  channel.times = readTimes(source, sampler.input, where);
  if (channel.interpolation == Interpolation::cubicSpline && channel.times.size() < 2) {
    source.notes().broken(NoteKind::keys, where, ": a CUBICSPLINE needs at least two keys");
  }
  // There is already a note about an accessor without elements.
  if (channel.times.empty()) return std::nullopt;
  channel.values = readValues(source, sampler.output, channel, where);
  if (channel.path == ChannelPath::rotation) normalizeRotations(channel, where, source.notes());
  return channel;
}

double column(const std::array<double, 16>& matrix, std::size_t index, std::size_t row) {
  return matrix[4 * index + row];
}

// The rotation of an orthonormal matrix (the columns divided by `scale`), from the largest of the
// four components: Shepperd, "Quaternion from rotation matrix", 1978.
std::array<double, 4> rotationOf(const std::array<double, 16>& matrix,
                                 const std::array<double, 3>& scale) {
  double m[3][3];
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t i = 0; i < 3; ++i) {
      m[row][i] = scale[i] != 0 ? column(matrix, i, row) / scale[i] : 0;
    }
  }
  const double trace = m[0][0] + m[1][1] + m[2][2];
  std::array<double, 4> q;
  if (trace > 0) {
    q = {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], 1 + trace};
  } else {
    const std::size_t a = m[0][0] > m[1][1] && m[0][0] > m[2][2] ? 0 : m[1][1] > m[2][2] ? 1 : 2;
    const std::size_t b = (a + 1) % 3, c = (a + 2) % 3;
    q[a] = 1 + m[a][a] - m[b][b] - m[c][c];
    q[b] = m[a][b] + m[b][a];
    q[c] = m[a][c] + m[c][a];
    q[3] = m[c][b] - m[b][c];
  }
  normalizeQuaternion(q);
  return q;
}

}  // namespace

void decompose(Node& node) {
  const std::array<double, 16> matrix = *node.matrix;
  node.matrix.reset();
  for (std::size_t i = 0; i < 3; ++i) {
    node.scale[i] = std::hypot(column(matrix, i, 0), column(matrix, i, 1), column(matrix, i, 2));
    node.translation[i] = column(matrix, 3, i);
  }
  const auto minor = [&](std::size_t row, std::size_t next) {
    return column(matrix, 1, row) * column(matrix, 2, next) -
           column(matrix, 1, next) * column(matrix, 2, row);
  };
  const double determinant = column(matrix, 0, 0) * minor(1, 2) +
                             column(matrix, 0, 1) * minor(2, 0) +
                             column(matrix, 0, 2) * minor(0, 1);
  if (determinant < 0) node.scale[0] = -node.scale[0];
  node.rotation = rotationOf(matrix, node.scale);
}

namespace {

// Decomposes a node's matrix, so that a channel can replace a part of it. The specification forbids
// such a node, but three.js accepts it.
void decomposeTarget(Model& model, const Channel& channel, const std::string& where, Notes& notes) {
  Node& node = model.nodes[channel.node];
  if (!node.matrix || channel.path == ChannelPath::weights) return;
  decompose(node);
  notes.broken(NoteKind::animatedMatrix, where, ": node ", channel.node,
               " has a matrix, which has been decomposed for the animation");
}

Clip readClip(Source& source, const tinygltf::Animation& animation, std::size_t index, Model& model,
              std::size_t& unknownPaths) {
  Clip clip;
  clip.name = animation.name;
  // Nodes and paths. The key has no enumeration: a set of one would be exported, because
  // enumerations are never hidden.
  std::set<std::pair<std::uint32_t, std::uint32_t>> targets;
  for (std::size_t i = 0; i < animation.channels.size(); ++i) {
    const std::string where = join("animation ", index, " channel ", i);
    auto channel = readChannel(source, animation, animation.channels[i], where, unknownPaths);
    if (!channel) continue;
    if (!targets.emplace(channel->node, static_cast<std::uint32_t>(channel->path)).second) {
      source.notes().broken(NoteKind::channel, where, ": another channel already animates the ",
                            animation.channels[i].target_path, " of node ", channel->node,
                            "; it is left out");
      continue;
    }
    decomposeTarget(model, *channel, where, source.notes());
    clip.duration = std::max(clip.duration, static_cast<double>(channel->times.back()));
    clip.channels.push_back(std::move(*channel));
  }
  std::ranges::sort(clip.channels, {},
                    [](const Channel& channel) { return std::pair(channel.node, channel.path); });
  return clip;
}

}  // namespace

void readAnimations(Source& source, Model& model) {
  std::size_t unknownPaths = 0;  // over the channels of all clips
  const auto& animations = source.content().animations;
  for (std::size_t i = 0; i < animations.size(); ++i) {
    model.clips.push_back(readClip(source, animations[i], i, model, unknownPaths));
  }
  if (unknownPaths > 0) {
    model.notes.push_back(
        join(counted(unknownPaths, "animation channel"), " left out: an unknown target"));
  }
}

std::optional<std::uint32_t> findClip(const Model& model, std::string_view numberOrName) {
  std::uint32_t number = 0;
  const char* end = numberOrName.data() + numberOrName.size();
  const auto [stop, error] = std::from_chars(numberOrName.data(), end, number);
  if (error == std::errc() && stop == end && number < model.clips.size()) return number;
  for (std::uint32_t i = 0; i < model.clips.size(); ++i) {
    if (model.clips[i].name == numberOrName) return i;
  }
  return std::nullopt;
}

}  // namespace dermis::gltf
