// Writes skinned primitives to a file. Vertices are in the order of the accessors, part after part,
// and are not welded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/result.h"

namespace dermis::cli {

/// One skinned primitive.
struct OutputPart {
  std::string name;  ///< never empty
  /// Data that skinning does not change: triangles, texture coordinates, colors, material.
  const gltf::Primitive* primitive = nullptr;
  std::vector<float> positions;  ///< 3 per vertex, in the scene's space
  std::vector<float> normals;    ///< 3 per vertex
  std::vector<float> tangents;   ///< 4 per vertex, the last is the handedness; or empty
};

struct OutputMesh {
  std::span<const gltf::Material> materials;  ///< those of the model
  std::vector<OutputPart> parts;              ///< in the order in which they are written
};

enum class OutputFormat { ply, obj, glb };

/// The format of a file by its extension, ignoring case; or nothing.
std::optional<OutputFormat> outputFormat(std::string_view fileName);

/// The name of a part: that of its node, or of its mesh, or the index of the node; plus the index
/// of the primitive if the mesh has several.
std::string partName(const gltf::Model& model, const gltf::SkinnedPrimitive& source);

/// The number of vertices with a position or normal that is NaN or infinite.
std::size_t countNonFinite(const OutputMesh& mesh);

/// Whether the format can store NaN and infinity. Only PLY can: glTF forbids them, and few readers
/// of OBJ can parse them.
bool holdsNonFinite(OutputFormat format);

/// Whether the format stores tangents. Only GLB does; for the others, tangents need not be skinned.
bool holdsTangents(OutputFormat format);

/// Binary glTF 2.0: for each part a node and a mesh of one primitive, with POSITION, NORMAL,
/// TANGENT, every TEXCOORD_n, COLOR_0, and the factors of its material. A part without triangles
/// becomes points without tangents, so that no vertex is lost. Values that glTF forbids are
/// repaired: normals are normalized (a zero normal becomes 0 0 1). Tangents are normalized (one
/// that is zero or not finite becomes perpendicular to the normal), with a handedness of 1 or -1.
/// Colors and factors are clamped. A texture coordinate that is not finite becomes 0. Positions and
/// normals must be finite. Empty if the file would be larger than 4 GiB.
std::vector<std::byte> glbFile(const OutputMesh& mesh);

/// Writes the file completely or not at all. Fails with `ioError`, or with `limitExceeded` if the
/// format cannot store such a large mesh. Values that are not finite must have been refused before,
/// unless the format holds them.
Result<void> writeMesh(const std::filesystem::path& path, OutputFormat format,
                       const OutputMesh& mesh);

}  // namespace dermis::cli
