#include "scene_meshes.h"

#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "dermis/layout.h"

namespace dermis::test {
namespace {

using Blob = std::vector<std::byte>;

Blob blobOf(const PackedMesh& mesh) {
  return {mesh.bytes().begin(), mesh.bytes().end()};
}

/// What every packed mesh was packed from, by its bytes: the reference starts from there.
std::map<Blob, OwnedMesh>& sources() {
  static std::map<Blob, OwnedMesh> all;
  return all;
}

}  // namespace

std::vector<std::byte> readAttribute(std::span<const std::byte> bytes,
                                     const OutputAttribute& attribute, std::uint32_t vertexCount) {
  const std::size_t size = formatSize(attribute.format);
  std::vector<std::byte> copy(size * vertexCount);
  for (std::size_t vertex = 0; size != 0 && vertex < vertexCount; ++vertex) {
    const std::size_t place = attribute.offset + vertex * attribute.stride;
    if (place + size > bytes.size()) throw std::runtime_error("an attribute leaves the output");
    std::memcpy(copy.data() + vertex * size, bytes.data() + place, size);
  }
  return copy;
}

Streams readStreams(std::span<const std::byte> bytes, const InstanceOutput& output,
                    std::uint32_t vertexCount) {
  Streams streams;
  for (std::size_t stream = 0; stream < streamCount; ++stream)
    streams[stream] = readAttribute(bytes, output.places.attributes[stream], vertexCount);
  return streams;
}

PackedMesh systemMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount,
                      std::uint32_t influences, std::uint32_t morphTargets) {
  OwnedMesh mesh = randomMesh(seed, vertexCount, jointCount, influences);
  addTangents(mesh, seed + 1);
  addMorphs(mesh, seed + 2, morphTargets);
  PackedMesh packed = must(pack(mesh.view(), jointCount));
  sources().try_emplace(blobOf(packed), std::move(mesh));
  return packed;
}

OwnedMesh* sourceOf(const PackedMesh& mesh) {
  const auto source = sources().find(blobOf(mesh));
  return source == sources().end() ? nullptr : &source->second;
}

VertexLayout plainLayout() {
  VertexLayout layout;
  layout.normals = VertexFormat::float32x3;
  return layout;
}

VertexLayout motionLayout() {
  VertexLayout layout = plainLayout();
  layout.motion = true;
  return layout;
}

std::set<std::uint32_t> indicesOf(std::span<const InstanceHandle> instances) {
  std::set<std::uint32_t> indices;
  for (const InstanceHandle instance : instances) {
    EXPECT_TRUE(indices.insert(instance.index).second) << "an instance is listed twice";
  }
  return indices;
}

}  // namespace dermis::test
