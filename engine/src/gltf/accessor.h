// Accessors: what a file's arrays of numbers are made of, checked and decoded.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "gltf/buffers.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/notes.h"

namespace dermis::gltf {

/// How an accessor stores its elements; for the sentences that say which are allowed.
struct Format {
  int componentType = 0;  ///< TINYGLTF_COMPONENT_TYPE_*
  bool normalized = false;
  bool operator==(const Format&) const = default;
};

/// A file opened for reading: its structure and its bytes.
class Source {
 public:
  /// Checks every bufferView and accessor against the buffers. What is decoded is spent on the
  /// budget. Budget and notes must outlive this object. Throws `Failure`.
  Source(Document document, std::vector<Buffer> buffers, MemoryBudget& budget, Notes& notes);

  const tinygltf::Model& content() const { return document_.content; }
  const Usage& usage() const { return document_.usage; }
  bool quantized() const { return document_.quantized; }
  Notes& notes() const { return notes_; }

  /// Takes an attribute out of a primitive, so that it is not read.
  void leaveOut(std::size_t mesh, std::size_t primitive, const std::string& attribute);

  /// Fails unless the accessor has this type (TINYGLTF_TYPE_*) and one of these formats. `where`
  /// says what it is for: "mesh 2 primitive 0 POSITION". `tolerated` are formats that may not stand
  /// there and yet have one meaning only: they are noted.
  void require(int accessor, int type, std::span<const Format> formats, const std::string& where,
               std::span<const Format> tolerated = {}) const;

  /// Notes where elements do not begin at multiples of 4 bytes, as those of vertex attributes must.
  void noteAttributeAlignment(int accessor, const std::string& where) const;

  /// Notes where the accessor's bufferView has a byteStride, which only vertex attributes may have.
  /// It is used nevertheless.
  void noteStride(int accessor, const std::string& where) const;

  /// How the accessor stores its components.
  Format format(int accessor) const;
  /// Elements of the accessor.
  std::uint32_t count(int accessor) const;
  /// Components of an element: 3 for VEC3.
  std::uint32_t components(int accessor) const;
  /// Neither a bufferView nor sparse values: all zeros.
  bool hasNoData(int accessor) const;

  /// All components of all elements as float32: integers as they are or, where normalized, divided
  /// by their largest value (signed ones clamped to −1 from below: glTF 2.0, 3.6.2.2).
  std::vector<float> floats(int accessor);
  /// The same for unsigned integers that are not normalized.
  std::vector<std::uint32_t> integers(int accessor);

  /// All components of all elements as they are stored, tightly packed.
  std::vector<std::byte> stored(int accessor);

  /// The bytes of a bufferView, whatever they are. Throws `Failure` with `invalidData` if there
  /// is no such view, or it has no bytes.
  std::span<const std::byte> viewBytes(std::uint64_t view, const std::string& where) const;

  /// Spends what is about to be made. Throws `Failure` with `limitExceeded`.
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
  template <typename Visit>
  void forEachComponent(int accessor, Visit visit);
  template <typename Value, typename Read>
  std::vector<Value> decode(int accessor, Read read);

  Document document_;
  std::vector<Buffer> buffers_;
  MemoryBudget& budget_;
  Notes& notes_;
  std::vector<bool> isFaulty_;  ///< Accessors that may not be read; nothing skinned uses them.
};

/// The name of a component type and normalization: "normalized unsigned byte".
std::string formatName(Format format);

}  // namespace dermis::gltf
