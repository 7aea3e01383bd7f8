// glTF 2.0 files as meshes, skeletons and clips, and the sampling of poses.
//
// What the specification forbids is caught here, with one sentence that names the accessor, node or
// skin at fault. Where it leaves the meaning clear, as with a byteStride where none may stand, the
// file is used and the sentence is a note; otherwise it is an error. A file can cause an error,
// never a crash, a hang, or more memory than its own bytes justify (memory_budget.h).
//
// Threads: every function may be called from any thread; a `Model` that nobody changes may be read
// by many at once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/export.h"
#include "dermis/memory_budget.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "dermis/types.h"

namespace dermis::gltf {

inline constexpr std::uint32_t none = 0xffffffffu;  ///< An index that points at nothing.

/// A node's own transform, either translation, rotation and scale, or a matrix. All are finite.
struct Node {
  std::string name;
  std::uint32_t parent = none;
  std::uint32_t mesh = none;
  std::uint32_t skin = none;  ///< Only where there is a mesh too.
  std::array<double, 3> translation{0, 0, 0};
  std::array<double, 4> rotation{0, 0, 0, 1};  ///< x y z w, of unit length
  std::array<double, 3> scale{1, 1, 1};
  /// Column-major, as in the file; used instead of the three above. A node that a clip moves has
  /// none: it has been taken apart into the three, with a note.
  std::optional<std::array<double, 16>> matrix;
  /// One a morph target where the node overrides its mesh's, or empty; those missing are 0.
  std::vector<float> morphWeights;
};

struct Skin {
  std::string name;
  /// Node indices, at most `maxPoseJoints`; a vertex's joint index counts in this list. Empty
  /// where the skin is broken and no node uses it.
  std::vector<std::uint32_t> joints;
  /// One a joint, finite; identities where the file has none.
  std::vector<JointMatrix> inverseBindMatrices;
};

enum class AlphaMode : std::uint8_t { opaque, mask, blend };

/// An image as it stands in the file: PNG or JPEG, not decoded.
struct Image {
  std::string name;  ///< "image 2 'skin'", for messages
  std::vector<std::byte> bytes;
};

enum class Wrap : std::uint8_t { repeat, mirroredRepeat, clampToEdge };

struct TextureUse {
  std::uint32_t image = none;  ///< In `Model::images`; it has bytes.
  std::uint32_t texcoord = 0;  ///< TEXCOORD_n, which a primitive need not have
  Wrap wrapU = Wrap::repeat, wrapV = Wrap::repeat;
};

/// The factors of a material; what the file leaves out has the default of glTF 2.0.
struct Material {
  std::string name;
  std::array<float, 4> baseColor{1, 1, 1, 1};  ///< Linear red, green, blue, and alpha.
  TextureUse baseColorTexture;                 ///< Only where `LoadOptions::images` is set.
  float metallic = 1;
  float roughness = 1;
  std::array<float, 3> emissive{0, 0, 0};
  AlphaMode alphaMode = AlphaMode::opaque;
  float alphaCutoff = 0.5f;
  bool doubleSided = false;
};

/// Displacements of one morph target, 3 floats a vertex; an absent attribute is empty.
struct MorphTarget {
  std::vector<float> positions, normals, tangents;
};

/// JOINTS_n and WEIGHTS_n of one n, 4 influences a vertex, tightly packed. The components are the
/// file's own: which of several weights is the greatest, and which are equal, is a matter of the
/// integers that it stores.
struct Influences {
  ComponentType jointType = ComponentType::uint8;     ///< uint8 or uint16
  ComponentType weightType = ComponentType::float32;  ///< float32, unorm8 or unorm16
  std::vector<std::byte> joints;
  std::vector<std::byte> weights;
};

/// One primitive of a mesh, decoded: float32 attributes whatever the file stores (normalised
/// integers divided by their largest value), influences as they are. Vertices stand in the order of
/// the accessors. Values are as the file has them, NaN included, and joint indices may lie outside
/// the skin: `validate` looks at both.
struct Primitive {
  /// For messages, which say "mesh" and put it in quotes: "Fox" if its mesh has no other primitive,
  /// otherwise "Fox primitive 1"; "number 3" instead of "Fox" if mesh 3 has no name. Short, and on
  /// one line (text.h).
  std::string name;
  std::uint32_t vertexCount = 0;
  std::vector<float> positions;               ///< 3 a vertex
  std::vector<float> normals;                 ///< 3 a vertex, or empty
  std::vector<float> tangents;                ///< 4 a vertex, or empty
  std::vector<std::vector<float>> texcoords;  ///< TEXCOORD_0, 1, …: 2 a vertex
  std::vector<float> colors;  ///< 4 a vertex (COLOR_0; alpha 1 where the file has none), or empty
  /// One a set. Empty where the primitive has none: it stays in bind pose, its positions as they
  /// are in the file.
  std::vector<Influences> influences;
  /// 3 indices a triangle; strips and fans are unrolled; empty for points and lines.
  std::vector<std::uint32_t> triangles;
  std::vector<MorphTarget> morphTargets;
  std::uint32_t material = none;  ///< In `Model::materials`.

  /// Slots of all sets together; some may have no weight.
  std::uint32_t influencesPerVertex() const {
    return 4 * static_cast<std::uint32_t>(influences.size());
  }
};

/// A primitive as `validate`, `pack` and `reference::skin` take it, with all its sets and morph
/// targets. It points into the primitive, which must outlive it, neither moved nor changed.
class DERMIS_GLTF_API PrimitiveView {
 public:
  explicit PrimitiveView(const Primitive& primitive);
  explicit PrimitiveView(const Primitive&& primitive) = delete;

  /// Valid while this object lives too and is neither moved nor assigned to. Its name is the
  /// primitive's; without influences it has no set.
  MeshView mesh() const&;
  MeshView mesh() const&& = delete;

 private:
  const Primitive* primitive_;
  std::vector<InfluenceSet> influenceSets_;
  std::vector<MorphTargetView> morphTargets_;
};

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
  /// Of the primitive that has the most, decoded or not; others move with the first of them.
  std::uint32_t morphTargetCount = 0;
  std::vector<float> morphWeights;  ///< One a morph target; those missing are 0.
};

enum class Interpolation : std::uint8_t { step, linear, cubicSpline };
enum class ChannelPath : std::uint8_t { translation, rotation, scale, weights };

/// One animated property of one node. A clip has at most one for a node and a path.
struct Channel {
  std::uint32_t node = none;
  ChannelPath path = ChannelPath::translation;
  Interpolation interpolation = Interpolation::linear;
  std::uint32_t components = 3;  ///< Values a key: 3, 4, or the number of morph targets.
  std::vector<float> times;      ///< Seconds: not falling, finite, not empty; equal ones: a jump.
  /// `components` a key, finite; for cubicSpline in-tangent, value, out-tangent: 3 × components.
  /// Rotations are of unit length (the values; tangents are as in the file).
  std::vector<float> values;
};

struct Clip {
  std::string name;
  double duration = 0;            ///< Seconds: the latest key, or 0 where that is earlier.
  std::vector<Channel> channels;  ///< By rising node, then path.
};

/// One skinned primitive of the default scene, in the order in which `dermis skin` writes them: by
/// ascending node index, then primitive index. Where several nodes use one mesh with different
/// skins each stands for itself. All indices are valid.
struct SkinnedPrimitive {
  std::uint32_t node = none;
  std::uint32_t mesh = none;
  std::uint32_t primitive = none;
  std::uint32_t skin = none;
};

/// A file. Every index in it is in range or `none`; the nodes are trees.
struct Model {
  std::vector<Node> nodes;
  std::vector<std::uint32_t> nodeOrder;  ///< All nodes, parents before their children.
  std::vector<Mesh> meshes;
  std::vector<Skin> skins;
  std::vector<Material> materials;
  /// Those that no base colour shows are empty, and so are those that equal another one.
  std::vector<Image> images;
  std::vector<Clip> clips;
  std::vector<SkinnedPrimitive> skinnedPrimitives;
  /// What was mended or left out, and which rules of glTF the file breaks without losing its
  /// meaning: a sentence for each kind, with its first place and how often it was found. At most
  /// some fifty, however large the file.
  std::vector<std::string> notes;
  /// The other files that were read, links followed: a program that writes must spare them.
  std::vector<std::filesystem::path> sideFiles;
  /// What the file may still make a program take: spend on it what is made for each node, primitive
  /// or skin, and the pixels of images, before it is made.
  MemoryBudget budget;
};

struct LoadOptions {
  /// Read the images that base colours show, by the same rules as buffers. One that cannot be had
  /// is left out, with a note.
  bool images = false;
  /// Broken rules that leave the meaning clear are errors (`invalidData`), too. This looks at what
  /// `load` reads anyway; it is no validator.
  bool strict = false;
};

/// Reads a .gltf or .glb file (told apart by their first bytes) and every buffer that it names:
/// data URIs and files beside it. Nothing outside the folder is opened, not by a symbolic link
/// either; the folder is that of `path` as given, even if the file there is a link to another. Each
/// side file is read once, as far as it is needed. No file may be larger than 4 GiB.
/// Meshes that no skinned node of the default scene uses are left undecoded (no primitives). The
/// default scene is `scene`; scene 0 where the file does not say; all root nodes where it has no
/// scenes. Fails with
/// - `ioError`: the file, or one that it names, cannot be read or lies outside the folder;
/// - `invalidData`: a broken file; the sentence names the accessor, node, skin … at fault. What
///   nothing skinned or animated uses may be broken, with a note;
/// - `unsupportedFeature`: a required extension that is not known (mesh compression, for one), or
///   glTF 1.0;
/// - `limitExceeded`: it asks for more memory than a file of its size justifies (memory_budget.h).
DERMIS_GLTF_API Result<Model> load(const std::filesystem::path& path,
                                   const LoadOptions& options = {});

/// The same from memory; `folder` is where the file's relative URIs are looked up, empty for
/// nowhere. Nothing refers to `bytes` afterwards.
DERMIS_GLTF_API Result<Model> loadFromMemory(std::span<const std::byte> bytes,
                                             const std::filesystem::path& folder,
                                             const LoadOptions& options = {});

/// The clip of that number or, where there is none of that number, the first of that name.
DERMIS_GLTF_API std::optional<std::uint32_t> findClip(const Model& model,
                                                      std::string_view numberOrName);

/// Row-major 3×4 in double precision: `[row][column]`, column 3 the translation.
using GlobalTransform = std::array<std::array<double, 4>, 3>;

/// The global transform of every node at a time in seconds, clamped to each channel's keys. `clip`
/// is `none` for the rest pose, and so is a clip that does not exist. At a key the key's value;
/// between keys as glTF 2.0, appendix C, says: slerp along the shorter arc for LINEAR rotations,
/// tangents scaled by the key distance for CUBICSPLINE. Rotations are normalised after
/// interpolation. A time that is not a number counts as one before the first key.
DERMIS_GLTF_API std::vector<GlobalTransform> nodeGlobals(const Model& model, std::uint32_t clip,
                                                         double time);

/// The pose of one skin: joint global transform × inverse bind matrix for each joint, computed
/// in double precision and rounded once to float32. The skinned node's own transform has no effect
/// (glTF 2.0, 3.7.3.3). `globals` is what `nodeGlobals` returned: work that several skins share.
/// Empty where the skin does not exist or `globals` is too short.
DERMIS_GLTF_API std::vector<JointMatrix> pose(const Model& model, std::uint32_t skin,
                                              std::span<const GlobalTransform> globals);

/// Both in one, for a model with one skin.
DERMIS_GLTF_API std::vector<JointMatrix> pose(const Model& model, std::uint32_t skin,
                                              std::uint32_t clip, double time);

/// The weight of every morph target of a node's mesh at a time in seconds: the clip's, sampled as
/// in `nodeGlobals`, where it moves the weights of that node; otherwise the node's own, otherwise
/// its mesh's, otherwise zeros. `clip` is as for `nodeGlobals`. As many as the mesh has targets;
/// empty where it has none, where the node has no mesh, and where there is no such node.
DERMIS_GLTF_API std::vector<float> morphWeights(const Model& model, std::uint32_t node,
                                                std::uint32_t clip, double time);

}  // namespace dermis::gltf
