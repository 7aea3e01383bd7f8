// KHR_draco_mesh_compression.
#include <cstring>
#include <map>
#include <memory>
#include <utility>

#include "gltf/compression.h"
#include "gltf/reader.h"

#ifdef DERMIS_DRACO
#include <draco/compression/decode.h>
#include <draco/compression/point_cloud/point_cloud_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>
#endif

namespace dermis::gltf {
namespace {

#ifdef DERMIS_DRACO
// The numbers at the beginning of a Draco stream.
struct StreamCounts {
  std::uint32_t points = 0;  // at least so many
  std::uint32_t faces = 0;
};

// Version 2.2, which the extension requires.
StreamCounts readCounts(draco::DecoderBuffer buffer, const std::string& where) {
  draco::DracoHeader header{};
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok() ||
      header.encoder_type != draco::TRIANGULAR_MESH) {
    failInvalid(where, ": its data is not a Draco mesh");
  }
  if (header.version_major != 2 || header.version_minor != 2) {
    failInvalid(where, ": its data has version ", header.version_major, ".", header.version_minor,
                " of Draco, not 2.2");
  }
  buffer.set_bitstream_version(draco::kDracoMeshBitstreamVersion);
  StreamCounts counts;
  draco::GeometryMetadata metadata;
  std::uint8_t traversal = 0;
  const bool isEdgebreaker = header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING;
  std::uint32_t& first = isEdgebreaker ? counts.points : counts.faces;
  std::uint32_t& second = isEdgebreaker ? counts.faces : counts.points;
  if (((header.flags & METADATA_FLAG_MASK) != 0 &&
       !draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata)) ||
      (isEdgebreaker && !buffer.Decode(&traversal)) || !draco::DecodeVarint(&first, &buffer) ||
      !draco::DecodeVarint(&second, &buffer)) {
    failInvalid(where, ": its data is truncated");
  }
  return counts;
}

int componentTypeOf(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8:
      return TINYGLTF_COMPONENT_TYPE_BYTE;
    case draco::DT_UINT8:
      return TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE;
    case draco::DT_INT16:
      return TINYGLTF_COMPONENT_TYPE_SHORT;
    case draco::DT_UINT16:
      return TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    case draco::DT_UINT32:
      return TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    case draco::DT_FLOAT32:
      return TINYGLTF_COMPONENT_TYPE_FLOAT;
    default:
      return 0;
  }
}

// The primitive's accessors have been checked: attributes have one count, and indices are integers.
class PrimitiveDecoder {
 public:
  PrimitiveDecoder(Document& document, std::vector<Buffer>& buffers, MemoryBudget& budget)
      : document_(document), content_(document.content), buffers_(buffers), budget_(budget) {}

  void decode(const CompressedPrimitive& from, const tinygltf::Primitive& primitive,
              const std::string& place) {
    const std::string where = join(place, " ", dracoExtension);
    const auto& attributes = primitive.attributes;
    if (!attributes.contains("POSITION")) return;  // the primitive is left out
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES)
      fail(ErrorCode::unsupportedFeature, join(where, ": only mode 4, triangles, is supported"));
    if (!attributes.contains(indicesAttribute))
      failInvalid(where, ": the primitive has no indices");
    // By accessor, the id in the stream.
    std::map<int, std::uint32_t> ids;
    for (const auto& [name, id] : from.attributes) {
      const auto found = attributes.find(name);
      if (found != attributes.end() && name != indicesAttribute) ids.emplace(found->second, id);
    }
    const int indices = attributes.at(indicesAttribute);
    // Its values were checked as numbers of the type in the file; decoded indices are of another.
    if (accessor(indices).sparse.isSparse) {
      fail(
          ErrorCode::unsupportedFeature,
          join(where, ": accessor ", indices, " of the indices is sparse, which is not supported"));
    }
    if (isDecoded(ids, indices, from.view, where)) return;

    const std::size_t vertexCount = accessor(attributes.at("POSITION")).count;
    const std::size_t indexCount = accessor(indices).count;
    // The maps that libdraco makes between corners, faces and vertices.
    spend(budget_, indexCount, 16 + 8 * (ids.size() + 1), where);
    for (const auto& [index, id] : ids) {
      // As values, as integers before they are converted, and in the accessor's buffer.
      spend(budget_, vertexCount, 3 * std::uint64_t{elementSize(index)} + 16, where);
    }
    const auto mesh = decodeMesh(from.view, vertexCount, indexCount, where);
    for (const auto& [index, id] : ids) fillVertices(*mesh, index, id, where);
    fillIndices(*mesh, indices);
  }

 private:
  tinygltf::Accessor& accessor(int index) {
    return content_.accessors[static_cast<std::size_t>(index)];
  }

  std::uint32_t elementSize(int index) {
    const auto component = static_cast<std::uint32_t>(accessor(index).componentType);
    const auto type = static_cast<std::uint32_t>(accessor(index).type);
    return static_cast<std::uint32_t>(tinygltf::GetComponentSizeInBytes(component) *
                                      tinygltf::GetNumComponentsInType(type));
  }

  // Primitives may share accessors, if they share the stream as well.
  bool isDecoded(const std::map<int, std::uint32_t>& ids, int indices, std::size_t view,
                 const std::string& where) {
    std::size_t known = 0;
    const auto isKnown = [&](int index, std::uint32_t id) {
      const auto [place, isNew] = document_.decodedAccessors.emplace(index, std::pair(view, id));
      if (place->second != std::pair(view, id))
        failInvalid(where, ": accessor ", index, " has other data in another primitive");
      if (!isNew) ++known;
    };
    for (const auto& [index, id] : ids) isKnown(index, id);
    isKnown(indices, noIndex);
    return known == ids.size() + 1;
  }

  std::unique_ptr<draco::Mesh> decodeMesh(std::size_t view, std::size_t vertexCount,
                                          std::size_t indexCount, const std::string& where) {
    const tinygltf::BufferView& range = content_.bufferViews[view];
    const std::span<const std::byte> bytes =
        bytesIn(buffers_, static_cast<std::size_t>(range.buffer), range.byteOffset,
                range.byteLength, join(where, " bufferView ", view));
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    // libdraco allocates memory for these numbers before it looks for the data.
    const StreamCounts counts = readCounts(buffer, where);
    checkCounts(counts.points, counts.faces, vertexCount, indexCount, where, true);
    auto result = draco::Decoder().DecodeMeshFromBuffer(&buffer);
    if (!result.ok()) {
      failInvalid(where,
                  ": its data cannot be decoded: ", inQuotes(result.status().error_msg_string()));
    }
    std::unique_ptr<draco::Mesh> mesh = std::move(result).value();
    checkCounts(mesh->num_points(), mesh->num_faces(), vertexCount, indexCount, where, false);
    return mesh;
  }

  static void checkCounts(std::uint32_t points, std::uint32_t faces, std::size_t vertexCount,
                          std::size_t indexCount, const std::string& where, bool mayGrow) {
    if ((mayGrow ? points <= vertexCount : points == vertexCount) &&
        std::uint64_t{faces} * 3 == indexCount)
      return;
    failInvalid(where, ": its data has ", points, " vertices and ", faces,
                " triangles, but the accessors have ", vertexCount, " and ", indexCount / 3);
  }

  void fillVertices(const draco::Mesh& mesh, int index, std::uint32_t id,
                    const std::string& where) {
    const tinygltf::Accessor& to = accessor(index);
    const draco::PointAttribute* from = mesh.GetAttributeByUniqueId(id);
    if (from == nullptr) failInvalid(where, ": its data has no attribute ", id);
    const std::size_t size = elementSize(index);
    if (componentTypeOf(from->data_type()) != to.componentType ||
        from->num_components() !=
            tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(to.type))) {
      failInvalid(where, ": attribute ", id, " of its data has another type than accessor ", index);
    }
    std::vector<std::byte> bytes(to.count * size);
    for (std::uint32_t i = 0; i < mesh.num_points(); ++i) {
      const draco::AttributeValueIndex value = from->mapped_index(draco::PointIndex(i));
      const auto place = static_cast<std::size_t>(from->GetBytePos(value));
      if (value.value() >= from->size() || place + size > from->buffer()->data_size())
        failInvalid(where, ": vertex ", i, " has no value of attribute ", id);
      std::memcpy(&bytes[std::size_t{i} * size], from->buffer()->data() + place, size);
    }
    fill(index, std::move(bytes));
  }

  void fillIndices(const draco::Mesh& mesh, int index) {
    std::vector<std::byte> bytes(std::size_t{mesh.num_faces()} * 3 * sizeof(std::uint32_t));
    std::byte* next = bytes.data();
    for (std::uint32_t i = 0; i < mesh.num_faces(); ++i) {
      for (const draco::PointIndex& point : mesh.face(draco::FaceIndex(i))) {
        const std::uint32_t vertex = point.value();
        std::memcpy(next, &vertex, sizeof vertex);
        next += sizeof vertex;
      }
    }
    // Whichever type of indices the accessor declares.
    accessor(index).componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    fill(index, std::move(bytes));
  }

  void fill(int index, std::vector<std::byte> bytes) {
    tinygltf::BufferView view;
    view.byteLength = bytes.size();
    view.buffer = addBuffer(buffers_, std::move(bytes));
    accessor(index).bufferView = static_cast<int>(content_.bufferViews.size());
    accessor(index).byteOffset = 0;
    content_.bufferViews.push_back(std::move(view));
    document_.usage.strides.push_back(0);
  }

  Document& document_;
  tinygltf::Model& content_;
  std::vector<Buffer>& buffers_;
  MemoryBudget& budget_;
};
#else
// A file that does not require the extension may have uncompressed data.
class PrimitiveDecoder {
 public:
  PrimitiveDecoder(const Document& document, const std::vector<Buffer>&, const MemoryBudget&)
      : content_(document.content) {}

  void decode(const CompressedPrimitive& from, const tinygltf::Primitive& primitive,
              const std::string& place) const {
    for (const auto& [name, index] : primitive.attributes) {
      const tinygltf::Accessor& accessor = content_.accessors[static_cast<std::size_t>(index)];
      const bool isCompressed = name == indicesAttribute || from.attributes.contains(name);
      if (!isCompressed || accessor.bufferView >= 0 || accessor.sparse.isSparse) continue;
      fail(ErrorCode::unsupportedFeature,
           join(place, ": accessor ", index, " has no data, but ", notDecoded(dracoExtension)));
    }
  }

 private:
  const tinygltf::Model& content_;
};
#endif

}  // namespace

void decodePrimitive(std::size_t mesh, std::size_t primitive, Document& document,
                     std::vector<Buffer>& buffers, MemoryBudget& budget) {
  const auto& compressed = document.usage.compressedPrimitives;
  const auto found = compressed.find({mesh, primitive});
  if (found == compressed.end()) return;
  PrimitiveDecoder(document, buffers, budget)
      .decode(found->second, document.content.meshes[mesh].primitives[primitive],
              primitivePlace(mesh, primitive));
}

}  // namespace dermis::gltf
