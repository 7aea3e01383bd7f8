#include "mesh_output.h"

#include <fmt/format.h>

#include <cmath>

#include "kit/file_name.h"
#include "kit/output_file.h"
#include "mesh_formats.h"

namespace dermis::cli {

std::optional<OutputFormat> outputFormat(std::string_view fileName) {
  if (samples::hasEnding(fileName, ".ply")) return OutputFormat::ply;
  if (samples::hasEnding(fileName, ".obj")) return OutputFormat::obj;
  if (samples::hasEnding(fileName, ".glb")) return OutputFormat::glb;
  return std::nullopt;
}

std::string partName(const gltf::Model& model, const gltf::SkinnedPrimitive& source) {
  const gltf::Mesh& mesh = model.meshes[source.mesh];
  std::string name = model.nodes[source.node].name;
  if (name.empty()) name = mesh.name;
  if (name.empty()) name = fmt::format("node {}", source.node);
  return mesh.primitives.size() == 1 ? name : fmt::format("{}.{}", name, source.primitive);
}

std::size_t countNonFinite(const OutputMesh& mesh) {
  std::size_t count = 0;
  for (const OutputPart& part : mesh.parts) {
    for (std::size_t vertex = 0; vertex * 3 < part.positions.size(); ++vertex) {
      bool finite = true;
      for (std::size_t i = vertex * 3; i < vertex * 3 + 3; ++i) {
        finite &= std::isfinite(part.positions[i]) && std::isfinite(part.normals[i]);
      }
      if (!finite) ++count;
    }
  }
  return count;
}

bool holdsNonFinite(OutputFormat format) {
  return format == OutputFormat::ply;
}

bool holdsTangents(OutputFormat format) {
  return format == OutputFormat::glb;
}

Result<void> writeMesh(const std::filesystem::path& path, OutputFormat format,
                       const OutputMesh& mesh) {
  if (format == OutputFormat::glb) {
    const std::vector<std::byte> bytes = glbFile(mesh);
    if (!bytes.empty()) return samples::writeFile(path, bytes);
    return Error{ErrorCode::limitExceeded,
                 fmt::format("{} would be larger than 4 GiB, the limit of GLB", path.string())};
  }
  const std::string bytes = format == OutputFormat::ply ? plyFile(mesh) : objFile(mesh);
  return samples::writeFile(path, bytes);
}

}  // namespace dermis::cli
