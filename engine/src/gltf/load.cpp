#include <exception>
#include <limits>
#include <new>
#include <system_error>
#include <utility>

#include "dermis/gltf.h"
#include "gltf/accessor.h"
#include "gltf/buffers.h"
#include "gltf/container.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/images.h"
#include "gltf/reader.h"

namespace dermis::gltf {
namespace {

Model readModel(std::span<const std::byte> bytes, const std::filesystem::path& folder,
                const LoadOptions& options) {
  const Container container = openContainer(bytes);
  Appearance appearance;
  Document document = parseDocument(container.json, options.images ? &appearance : nullptr);
  std::vector<Buffer> buffers = loadBuffers(document.buffers, container.binaryChunk, folder);
  Source source(std::move(document), std::move(buffers), bytes.size());

  Model model;
  readNodes(source, model);
  readSkins(source, model);
  readMaterials(source, model);
  checkPrimitives(source);
  readScene(source, model);
  readAnimations(source, model);
  if (options.images) readImages(appearance, source, folder, model);
  return model;
}

// The one place where exceptions end: `Failure`s, and whatever the libraries underneath throw.
template <typename Function>
Result<Model> guarded(Function function) {
  try {
    return function();
  } catch (Failure& failure) {
    return std::move(failure.error);
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::limitExceeded, "there is not enough memory for the file"};
  } catch (const std::exception& exception) {
    return Error{ErrorCode::invalidData, join("the file cannot be read: ", exception.what())};
  }
}

}  // namespace

Result<Model> loadFromMemory(std::span<const std::byte> bytes, const std::filesystem::path& folder,
                             const LoadOptions& options) {
  return guarded([&] { return readModel(bytes, folder, options); });
}

Result<Model> load(const std::filesystem::path& path, const LoadOptions& options) {
  return guarded([&] {
    std::error_code error;
    // Not a device or a pipe, which might never end. What does not exist is left to readFile.
    if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error)) {
      fail(ErrorCode::ioError, join(inQuotes(path.string()), " is not a file"));
    }
    const auto bytes = readFile(path, std::numeric_limits<std::uint64_t>::max(), "glTF file");
    // A name without a folder stands in the current one; an empty folder would mean that there is
    // none.
    const auto folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
    try {
      return readModel(bytes, folder, options);
    } catch (Failure& failure) {
      failure.error.message = join(inQuotes(path.filename().string()), ": ", failure.error.message);
      throw;
    }
  });
}

}  // namespace dermis::gltf
