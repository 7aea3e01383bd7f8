// Accessors (a file's arrays of numbers), checked and decoded.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "gltf/buffers.h"
#include "gltf/compression.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/notes.h"

namespace dermis::gltf {

/// How an accessor stores its elements; used in messages about which formats are allowed.
struct Format {
  int componentType = 0;  ///< TINYGLTF_COMPONENT_TYPE_*
  bool normalized = false;
  bool operator==(const Format&) const = default;
};

/// A file opened for reading: its structure and its bytes.
class Source {
 public:
  /// Checks every bufferView and accessor against the buffers. Each call that decodes data spends
  /// its memory from the budget. Budget and notes must outlive this object. Throws `Failure`.
  Source(Document document, std::vector<Buffer> buffers, MemoryBudget& budget, Notes& notes);

  const tinygltf::Model& content() const { return document_.content; }
  const Usage& usage() const { return document_.usage; }
  bool quantized() const { return document_.quantized; }
  Notes& notes() const { return notes_; }

  /// What the `extras` say. That of an object can be taken once.
  std::vector<std::string> takeTargetNames(std::size_t mesh) {
    return std::move(document_.targetNames[mesh]);
  }
  std::string takeRig(std::size_t skin) { return std::move(document_.rigs[skin]); }

  /// Decodes a primitive's data if it is compressed. Call it before the primitive's accessors are
  /// read.
  void decompress(std::size_t mesh, std::size_t primitive) {
    decodePrimitive(mesh, primitive, document_, buffers_, budget_);
  }

  /// Removes an attribute from a primitive, so that it is not read.
  void leaveOut(std::size_t mesh, std::size_t primitive, const std::string& attribute);

  /// Fails unless the accessor has this type (TINYGLTF_TYPE_*) and one of these formats. `where`
  /// says what the accessor is for: "mesh 2 primitive 0 POSITION". `tolerated` are formats that the
  /// specification does not allow but that have only one meaning: they are noted.
  void require(int accessor, int type, std::span<const Format> formats, const std::string& where,
               std::span<const Format> tolerated = {}) const;

  /// Adds a note if elements do not begin at multiples of 4 bytes, as vertex attributes must.
  void noteAttributeAlignment(int accessor, const std::string& where) const;

  /// Adds a note if the accessor's bufferView has a byteStride, which only vertex attributes may
  /// have. The stride is used nevertheless.
  void noteStride(int accessor, const std::string& where) const;

  /// How the accessor stores its components.
  Format format(int accessor) const;
  /// Number of elements of the accessor.
  std::uint32_t count(int accessor) const;
  /// Number of components of an element: 3 for VEC3.
  std::uint32_t components(int accessor) const;
  /// The accessor has neither a bufferView nor sparse values: it is all zeros.
  bool hasNoData(int accessor) const;
  /// The accessor has no bufferView: elements without a sparse value are zero.
  bool isZeroElsewhere(int accessor) const;

  /// All components of all elements as float32. Normalized integers are divided by their largest
  /// value, and signed ones clamped to at least −1 (glTF 2.0, 3.6.2.2); other integers keep their
  /// value.
  std::vector<float> floats(int accessor);
  /// The same for unsigned integers that are not normalized.
  std::vector<std::uint32_t> integers(int accessor);

  struct SparseValues {
    std::vector<std::uint32_t> elements;  ///< in the order of the file
    std::vector<float> values;            ///< all components of each element
  };
  /// Only the sparse values of an accessor, converted as by `floats`.
  SparseValues sparseFloats(int accessor);

  /// All components of all elements as they are stored, tightly packed.
  std::vector<std::byte> stored(int accessor);

  /// The bytes of a bufferView, whatever they contain. Throws `Failure` with `invalidData` if there
  /// is no such view or it has no bytes.
  std::span<const std::byte> viewBytes(std::uint64_t view, const std::string& where) const;

  /// Spends the memory of elements that are about to be made. Throws `Failure` with
  /// `limitExceeded`.
  void spend(std::uint64_t elements, std::uint64_t bytesEach, const std::string& where) {
    gltf::spend(budget_, elements, bytesEach, where);
  }

 private:
  void checkView(std::size_t index) const;
  void checkViews() const;
  void checkAccessor(std::size_t index) const;
  void checkAccessors();
  void checkSparse(std::size_t index) const;
  void checkRange(int view, std::uint64_t byteOffset, std::uint64_t bytes, std::uint64_t alignment,
                  const std::string& where) const;
  bool hasBytes(const tinygltf::Accessor& accessor) const;
  void refuseFaulty(int accessor) const;
  std::uint64_t sizeOf(int view) const;
  std::uint32_t strideOf(int view) const;
  const std::byte* viewData(int view) const;
  std::uint64_t strideOf(const tinygltf::Accessor& accessor) const;
  void spendOnAccessor(int accessor);
  std::vector<std::uint32_t> sparseIndices(int accessor);
  const std::byte* sparseData(int accessor) const;
  template <typename Visit>
  void forEachComponent(int accessor, Visit visit);
  template <typename Value, typename Read>
  std::vector<Value> decode(int accessor, Read read);

  Document document_;
  std::vector<Buffer> buffers_;
  MemoryBudget& budget_;
  Notes& notes_;
  std::vector<bool> isFaulty_;  ///< accessors that must not be read; nothing skinned or animated
                                ///< uses them
};

/// The name of a component type and normalization: "normalized unsigned byte".
std::string formatName(Format format);

}  // namespace dermis::gltf
