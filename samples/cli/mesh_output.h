// Writes skinned primitives to a file: the part that all formats share.
#pragma once

#include <cstddef>
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
  std::vector<float> positions;  ///< 3 a vertex, in the scene's space
  std::vector<float> normals;    ///< 3 a vertex
  std::vector<float> tangents;   ///< 4 a vertex, the last the handedness; or empty
};

struct OutputMesh {
  std::span<const gltf::Material> materials;  ///< those of the model
  std::vector<OutputPart> parts;              ///< in the order in which they are written
};

enum class OutputFormat { ply, obj, glb };

/// The format that a file's ending means, in any case, or nothing.
std::optional<OutputFormat> outputFormat(std::string_view fileName);

/// The name of a part: that of its node, or of its mesh, or the number of the node; and the number
/// of the primitive if the mesh has several.
std::string partName(const gltf::Model& model, const gltf::SkinnedPrimitive& source);

/// Vertices with a position or normal that is NaN or infinite.
std::size_t countNonFinite(const OutputMesh& mesh);

/// Only PLY stores floats as they are. glTF forbids what is not finite, and few readers of OBJ know
/// how to spell it.
bool holdsNonFinite(OutputFormat format);

/// Only GLB: for the others tangents need not be skinned.
bool holdsTangents(OutputFormat format);

/// Writes a file whole or not at all. Fails with `ioError`, and with `limitExceeded` if the
/// format cannot hold so large a mesh. What is not finite must
/// have been refused before, unless the format holds it.
Result<void> writeMesh(const std::filesystem::path& path, OutputFormat format,
                       const OutputMesh& mesh);

}  // namespace dermis::cli
