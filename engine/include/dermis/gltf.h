// Loads glTF 2.0 files as meshes, skins and clips, and samples poses.
//
// If a file breaks a rule of the specification, a message names the accessor, node or skin at
// fault. If the meaning is still clear (for example a byteStride that is not allowed), the file is
// used and the message is a note. Otherwise the message is an error. A damaged or hostile file can
// cause an error, but never a crash, a hang, or more memory than its size justifies: 64 MiB, plus
// 64 times the bytes that are read from the file and from the files that it names.
//
// Threads: any thread may call any function. Many threads may read a `Model` at the same time, if
// none changes it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "dermis/rig.h"

namespace dermis::gltf {

/// A node: its local transform and what it contains. All numbers are finite.
struct Node {
  std::string name;
  std::uint32_t parent = noIndex;  ///< index into `Model::nodes`
  std::uint32_t mesh = noIndex;    ///< index into `Model::meshes`
  std::uint32_t skin = noIndex;    ///< index into `Model::skins`; only nodes with a mesh have one
  std::array<double, 3> translation{0, 0, 0};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< x, y, z, w, of unit length
  std::array<double, 3> scale{1, 1, 1};
  /// Column-major, as in the file. If there is one, it replaces the three members above. A node
  /// whose translation, rotation or scale a clip animates has none: its matrix has been decomposed
  /// into these members, with a note.
  std::optional<std::array<double, 16>> matrix;
  /// Morph weights that override those of the mesh, one for each of its morph targets; empty if the
  /// node has none.
  std::vector<float> morphWeights;
};

/// A skin: its joints and their inverse bind matrices.
struct Skin {
  std::string name;
  /// Node indices, at most `maxPoseJoints`. The joint index of a vertex is an index into this list.
  /// Empty if the skin is invalid and no node uses it.
  std::vector<std::uint32_t> joints;
  /// One for each joint, finite. Identities if the file has none.
  std::vector<JointMatrix> inverseBindMatrices;
  /// JSON text for `applyRig`: `dermis_rig` in the skin's `extras`. Empty if there is none.
  std::string rig = {};
};

/// An image as it is in the file: PNG or JPEG, not decoded.
struct Image {
  std::string name;  ///< for messages: "image 2 'skin'"
  std::vector<std::byte> bytes;
};

/// The factors of a material. What the file leaves out has the default of glTF 2.0.
struct Material {
  /// How alpha is used, as in glTF 2.0.
  enum class AlphaMode : std::uint8_t { opaque = 0, mask = 1, blend = 2 };
  /// How texture coordinates outside [0, 1] are used, as in glTF 2.0.
  enum class Wrap : std::uint8_t { repeat = 0, mirroredRepeat = 1, clampToEdge = 2 };
  /// An image, and how it is used.
  struct Texture {
    std::uint32_t image = noIndex;  ///< index into `Model::images`; that image has bytes
    std::uint32_t texcoord = 0;     ///< n of TEXCOORD_n; a primitive need not have it
    Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
  };

  std::string name;
  std::array<float, 4> baseColor{1, 1, 1, 1};  ///< linear red, green, blue, and alpha
  Texture baseColorTexture;                    ///< only if `LoadOptions::images` is set
  float metallic = 1;
  float roughness = 1;
  std::array<float, 3> emissive{0, 0, 0};
  AlphaMode alphaMode = AlphaMode::opaque;
  float alphaCutoff = 0.5f;
  bool doubleSided = false;
};

/// An array that cannot be changed. Copies share its memory, and so do all primitives that use the
/// same accessor: a shared accessor is decoded once.
template <typename T>
class SharedArray {
 public:
  SharedArray() = default;
  /// Takes the values.
  SharedArray(std::vector<T> values)
      : values_(std::make_shared<const std::vector<T>>(std::move(values))) {}

  /// The values. Valid while this array or a copy of it exists.
  const std::vector<T>& values() const {
    static const std::vector<T> noValues;
    return values_ ? *values_ : noValues;
  }
  operator const std::vector<T>&() const { return values(); }  ///< `values`

  // As of a vector.
  const T* data() const { return values().data(); }     ///< the first value
  std::size_t size() const { return values().size(); }  ///< number of values
  bool empty() const { return values().empty(); }       ///< whether there are none
  const T& operator[](std::size_t index) const { return values()[index]; }  ///< a value
  auto begin() const { return values().begin(); }                           ///< of the values
  auto end() const { return values().end(); }                               ///< of the values

  /// Compares the values.
  friend bool operator==(const SharedArray& a, const SharedArray& b) {
    return a.values() == b.values();
  }

 private:
  std::shared_ptr<const std::vector<T>> values_;
};

/// Displacements of one morph target, 3 floats per element. An absent attribute is empty.
struct MorphTarget {
  /// The vertices that the elements belong to, strictly ascending. If empty, there is an element
  /// for each vertex. Not empty if all accessors of the target have only sparse values.
  SharedArray<std::uint32_t> vertices;
  SharedArray<float> positions, normals, tangents;
};

/// JOINTS_n and WEIGHTS_n of one n: 4 influences per vertex, tightly packed. The component types
/// are those of the file, so that it is known exactly which weights are equal and which is the
/// largest.
struct Influences {
  ComponentType jointType = ComponentType::uint8;     ///< uint8 or uint16
  ComponentType weightType = ComponentType::float32;  ///< float32, unorm8 or unorm16
  SharedArray<std::byte> joints;
  SharedArray<std::byte> weights;
};

/// One decoded primitive of a mesh. Attributes are float32 whatever the file stores: normalized
/// integers are divided by their maximum. Influences keep their types. Vertices are in the order of
/// the accessors, or of the decoder if Draco compresses the primitive, unless
/// `MissingNormals::flat` repeats them. Values are those of the file, so they may be NaN, and joint
/// indices may be outside the skin: `validate` checks both.
struct Primitive {
  /// For messages, which put it in quotes: "Fox" if its mesh has no other primitive, otherwise "Fox
  /// primitive 1". "number 3" instead of "Fox" if mesh 3 has no name. Short, on one line,
  /// and without characters that a terminal interprets.
  std::string name;
  std::uint32_t vertexCount = 0;
  SharedArray<float> positions;               ///< 3 per vertex
  SharedArray<float> normals;                 ///< 3 per vertex, or empty
  SharedArray<float> tangents;                ///< 4 per vertex, or empty
  std::vector<SharedArray<float>> texcoords;  ///< TEXCOORD_0, 1, …: 2 per vertex each
  SharedArray<float> colors;  ///< COLOR_0: 4 per vertex, or empty; alpha is 1 if the file has none
  /// One element for each set. If empty, the primitive stays in bind pose: `pack` refuses it, and
  /// it is drawn without skinning.
  std::vector<Influences> influences;
  /// 3 vertex indices per triangle. Strips and fans are converted. Empty for points and lines.
  SharedArray<std::uint32_t> triangles;
  std::vector<MorphTarget> morphTargets;
  std::uint32_t material = noIndex;  ///< index into `Model::materials`

  /// Influences of all sets together. Some may have weight 0.
  std::uint32_t influencesPerVertex() const {
    return 4 * static_cast<std::uint32_t>(influences.size());
  }
};

/// Makes a `MeshView` of a primitive, with all its influence sets and morph targets, for
/// `validate`, `pack` and `reference::skin`. It points into the primitive, which must outlive it
/// and must not be moved or changed.
class DERMIS_GLTF_API PrimitiveView {
 public:
  /// A view of this primitive.
  explicit PrimitiveView(const Primitive& primitive);
  explicit PrimitiveView(const Primitive&& primitive) = delete;

  /// The view. It is valid until this object is destroyed, moved or assigned to. It has the name of
  /// the primitive. Without influences it has no influence set.
  MeshView mesh() const&;
  MeshView mesh() const&& = delete;

 private:
  const Primitive* primitive_;
  std::vector<InfluenceSet> influenceSets_;
  std::vector<MorphTargetView> morphTargets_;
};

/// A mesh: its primitives.
struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;  ///< empty if the mesh is not decoded (see `load`)
  /// The largest number of morph targets of a primitive, decoded or not. A primitive with fewer has
  /// the first targets; the others do not displace it. After `applyRig` it does not count those
  /// that the rig drives, which are the last ones of each primitive.
  std::uint32_t morphTargetCount = 0;
  std::vector<float> morphWeights;  ///< one for each morph target
  /// `targetNames` in the `extras` of the file's mesh, or empty. It may have any length.
  std::vector<std::string> morphTargetNames = {};
};

using dermis::ChannelPath;
using dermis::Interpolation;

/// One animated property of one node. A clip has at most one channel for a node and a path.
struct Channel {
  std::uint32_t node = noIndex;
  ChannelPath path = ChannelPath::translation;
  Interpolation interpolation = Interpolation::linear;
  std::uint32_t components = 3;  ///< values per key: 3, 4, or the number of morph targets
  /// Seconds, finite, not descending, at least one. If two are equal, the value jumps there.
  std::vector<float> times;
  /// `components` finite values for each key. For `cubicSpline` 3 × `components`: in-tangent,
  /// value, out-tangent. Rotations have unit length; their tangents are as in the file.
  std::vector<float> values;
};

/// An animation.
struct Clip {
  std::string name;
  double duration = 0;            ///< seconds: the time of the last key in its file, at least 0
  std::vector<Channel> channels;  ///< by ascending node, then path
};

/// One skinned primitive of the default scene. If several nodes use a mesh with different skins,
/// each node has its own. All indices are valid.
struct SkinnedPrimitive {
  std::uint32_t node = noIndex;
  std::uint32_t mesh = noIndex;
  std::uint32_t primitive = noIndex;
  std::uint32_t skin = noIndex;
};

/// The contents of a file. Every index is in range or `noIndex`. The nodes form trees.
struct Model {
  std::vector<Node> nodes;
  std::vector<std::uint32_t> nodeOrder;  ///< indices of all nodes, parents before their children
  std::vector<Mesh> meshes;
  std::vector<Skin> skins;  ///< those of the file, then one for each node with a rigid mesh
  std::vector<Material> materials;
  /// An image has no bytes if no base color uses it, or if it is equal to another image.
  std::vector<Image> images;
  std::vector<Clip> clips;
  /// By ascending node index, then primitive index: the order in which `dermis skin` writes them.
  /// Those of rigid meshes follow.
  std::vector<SkinnedPrimitive> skinnedPrimitives;
  /// What was fixed or left out, and which rules of glTF the file breaks. One sentence for each
  /// kind, with the first place and the number of places. There are about fifty kinds at most.
  std::vector<std::string> notes;
  /// The other files that were read, with links resolved. A program that writes must not overwrite
  /// them.
  std::vector<std::filesystem::path> sideFiles;
  /// Bytes that the file may still make the program use. Subtract from them before you allocate
  /// something for each node, primitive or skin, or the pixels of an image.
  std::uint64_t memoryLeft = 0;
};

/// What `load` computes for primitives that have triangles and no normals.
enum class MissingNormals : std::uint8_t {
  leave = 0,   ///< nothing: the primitive has no normals
  smooth = 1,  ///< smooth normals; its vertices stay
  /// Flat normals, as glTF 2.0 demands. Its vertices are repeated, one for each corner of a
  /// triangle, with all their attributes, influences and displacements; `Primitive::triangles`
  /// counts up. Takes more memory and time.
  flat = 2,
};

/// What `load` reads and accepts.
struct LoadOptions {
  /// Whether to read the images of base colors, by the same rules as buffers. An image that cannot
  /// be read is left out, with a note.
  bool images = false;
  /// Whether to read rigid meshes that hang on a skeleton, such as hats and swords: meshes of nodes
  /// without a skin that are, or are below, joints of something skinned. Each such node gets a skin
  /// with itself as the only joint, and each vertex one influence; so they are skinned like the
  /// others. A mesh that cannot be read, or that is also used with a skin, is left out, with a
  /// note.
  bool rigidMeshes = false;
  /// Tangents of a primitive whose normals are computed are ignored, as glTF 2.0 demands, and so
  /// are the displacements of normals and tangents by its morph targets.
  MissingNormals missingNormals = MissingNormals::leave;
  /// Whether a broken rule is an error (`invalidData`) even if the meaning is clear. `load` checks
  /// only what it reads, and not the values of vertices: `validate` does that.
  bool strict = false;
};

/// Reads a .gltf or .glb file and all buffers that it names: data URIs, and files in its folder.
/// The first bytes tell which kind of file it is.
///
/// Nothing outside the folder of `path` is opened, not even through a symbolic link. `path` itself
/// may be a link to a file elsewhere; the folder is then that of the link. Each file is read
/// as far as it is needed, which must be at most 4 GiB.
///
/// Only meshes that a skinned node of the default scene uses, and rigid meshes if requested, are
/// decoded; the others have no primitives. The default scene is the one that the property `scene`
/// selects, or scene 0. If the file has no scenes, it consists of all root nodes.
///
/// Fails with
/// - `invalidArgument` if `LoadOptions::missingNormals` is no value of its type;
/// - `ioError` if a file cannot be read, or is outside the folder;
/// - `invalidData` if the file is invalid. The message names the accessor, node or skin at fault.
///   An error in a part that nothing skinned or animated uses is a note instead;
/// - `unsupportedFeature` if the file requires an unknown extension, or one that this build does
///   not decode (`DERMIS_MESHOPTIMIZER`, `DERMIS_DRACO`), or is glTF 1.0;
/// - `limitExceeded` if more than 4 GiB of a file are needed, if a skin has more than
///   `maxPoseJoints` joints, if the model needs more memory than the files' sizes justify, or if
///   there is not enough memory.
DERMIS_GLTF_API Result<Model> load(const std::filesystem::path& path,
                                   const LoadOptions& options = {});

/// The same for a file in memory. Relative URIs are looked up in `folder`; if it is empty, there
/// are no other files. The model does not refer to `bytes` afterwards.
DERMIS_GLTF_API Result<Model> loadFromMemory(std::span<const std::byte> bytes,
                                             const std::filesystem::path& folder,
                                             const LoadOptions& options = {});

/// The index of the clip with this number; if there is none, of the first clip with this name.
/// Empty if there is neither.
DERMIS_GLTF_API std::optional<std::uint32_t> findClip(const Model& model,
                                                      std::string_view numberOrName);

/// Adds the clips of another model after those of `model`, so that they move its nodes. The other
/// model is often a file of animations: it needs neither meshes nor skins, and its nodes may have
/// another order.
///
/// A channel animates the node of `model` that has the name of the channel's node. If several have
/// it, that is the first joint of a skin among them, or the first node if none is a joint; for
/// weights it is the first with morph targets. If two animated nodes have one name, joints are used
/// first. If distances between nodes and their parents differ by a factor of more than 3 (the
/// median over all nodes with a common name), the other model has another unit of length, and its
/// translations are scaled.
///
/// Channels without such a node, and weights for another number of morph targets, are left out. A
/// clip of which nothing is left is added, too, so that clips keep their order. The function also
/// adds the other model's side files.
///
/// Returns notes about all this, in the form of `Model::notes`. They speak of `model` as "the
/// model". Fails with
/// - `invalidData` if the other model has no clips, or if no channel finds a node;
/// - `limitExceeded` if matching needs more memory than the budget of the other model has left.
/// `model` is then unchanged.
DERMIS_GLTF_API Result<std::vector<std::string>> addClips(Model& model, Model from);

/// Reads a rig of a skin, JSON as docs/rigs.md describes it, and applies it to the model:
/// - The skin keeps the written joints of the rig, in their order. The joints of vertices are those
///   of the rig: written joints, driven joints of the skin, then those of chains.
/// - Vertices that follow a chain are bound to it (`bendChain`).
/// - If a mesh of the skin has some of the morph targets that the rig drives, all of these become
///   its last ones, in the order of the rig's weights (`InstanceDescription::drivenTargets`). Their
///   weights are removed from nodes and clips.
/// - A mesh that nodes with other skins have, too, is copied, so that those stay as they are.
/// - A written joint below a driven one, which it does not follow, is a note (`Model::notes`).
///
/// Call it once for a skin, after `addClips`. Returns a view of the rig that owns what it points
/// to; `packRig` does not fail for it. Given weights are those of the node `RigView::weightsOf`; if
/// no linear driver reads one, there are none.
///
/// Fails, and then leaves the model unchanged, with
/// - `invalidArgument` if there is no such skin;
/// - `invalidData` if the text is wrong; the message names the driver by its number and what is
///   wrong about it. Also if a vertex follows a joint that the skin does not have;
/// - `limitExceeded` if there are more than 65,535 joints, more than `maxRigExamples` examples, or
///   if it needs more memory than the sizes of the model's files and of the text justify.
DERMIS_GLTF_API Result<std::shared_ptr<const RigView>> applyRig(Model& model, std::uint32_t skin,
                                                                std::string_view text);

/// The global transforms of all nodes at a time of a clip, in seconds. If `clip` is `noIndex` or
/// does not exist, it is the rest pose.
///
/// The time is clamped to the keys of each channel; NaN counts as a time before the first key. For
/// a loop, pass the time modulo `Clip::duration`. At a key the result is the value of the key.
/// Between keys it is interpolated as glTF 2.0, appendix C, defines: LINEAR rotations by slerp
/// along the shorter arc, CUBICSPLINE with tangents scaled by the distance of the keys. Rotations
/// are normalized after the interpolation.
DERMIS_GLTF_API std::vector<Transform> nodeGlobals(const Model& model, std::uint32_t clip,
                                                   double time);

/// The pose of a skin: joint global transform × inverse bind matrix for each joint, computed in
/// double precision and rounded once to float32. `globals` is what `nodeGlobals` returned; all
/// skins can share it. The transform of the skinned node has no effect (glTF 2.0, 3.7.3.3). Empty
/// if the skin does not exist or `globals` is too short.
DERMIS_GLTF_API std::vector<JointMatrix> pose(const Model& model, std::uint32_t skin,
                                              std::span<const Transform> globals);

/// `nodeGlobals` and `pose` in one call. For several skins, call `nodeGlobals` once instead.
DERMIS_GLTF_API std::vector<JointMatrix> pose(const Model& model, std::uint32_t skin,
                                              std::uint32_t clip, double time);

/// The weights of all morph targets of a node's mesh at a time of a clip, in seconds; `clip` and
/// `time` as in `nodeGlobals`. If the clip animates the weights of the node, they are sampled.
/// Otherwise they are the weights of the node, or of its mesh, or zeros. There is one for each
/// target of the mesh. Empty if the mesh has no targets, the node has no mesh, or there is no such
/// node.
DERMIS_GLTF_API std::vector<float> morphWeights(const Model& model, std::uint32_t node,
                                                std::uint32_t clip, double time);

/// All nodes and skins of the model, with its numbers, as `packClips` takes them. Points into the
/// model, which must outlive it and must not be changed.
DERMIS_GLTF_API Skeleton skeleton(const Model& model);
Skeleton skeleton(const Model&& model) = delete;

/// All clips of the model, with its numbers, as `packClips` takes them. Points into the model,
/// which must outlive them and must not be changed.
DERMIS_GLTF_API std::vector<ClipView> clips(const Model& model);
std::vector<ClipView> clips(const Model&& model) = delete;

}  // namespace dermis::gltf
