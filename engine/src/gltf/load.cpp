#include <utility>

#include "dermis/gltf.h"
#include "gltf/accessor.h"
#include "gltf/buffers.h"
#include "gltf/compression.h"
#include "gltf/container.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/files.h"
#include "gltf/images.h"
#include "gltf/notes.h"
#include "gltf/reader.h"

namespace dermis::gltf {
namespace {

Model readModel(std::span<const std::byte> bytes, const std::filesystem::path& folder,
                const LoadOptions& options) {
  if (options.missingNormals > MissingNormals::flat)
    fail(ErrorCode::invalidArgument, "LoadOptions::missingNormals is no value of MissingNormals");
  Model model;
  MemoryBudget budget;
  budget.addFile(bytes.size());
  spend(budget, bytes.size(), 1, "the file");
  Notes notes(options.strict);
  const Container container = openContainer(bytes, notes);
  Appearance appearance;
  Document document =
      parseDocument(container.json, budget, notes, options.images ? &appearance : nullptr);
  SideFiles files(folder, budget);
  std::vector<Buffer> buffers = loadBuffers(document, container.binaryChunk, files, budget, notes);
  decodeViews(document, buffers, budget, notes);
  Source source(std::move(document), std::move(buffers), budget, notes);

  readNodes(source, model);
  readSkins(source, model);
  readMaterials(source, model);
  const std::vector<bool> faultyMeshes = checkPrimitives(source);
  readScene(source, faultyMeshes, options, model);
  readAnimations(source, model);
  if (options.images) readImages(appearance, source, files, budget, model);
  model.sideFiles = files.paths();
  model.memoryLeft = budget.left();
  notes.appendTo(model.notes);
  return model;
}

}  // namespace

Result<Model> loadFromMemory(std::span<const std::byte> bytes, const std::filesystem::path& folder,
                             const LoadOptions& options) {
  return guarded<Model>([&] { return readModel(bytes, folder, options); });
}

Result<Model> load(const std::filesystem::path& path, const LoadOptions& options) {
  return guarded<Model>([&] {
    // The name is the user's, not a file's: it is not cut.
    const FileToRead file = findFile(path, join("'", oneLine(utf8(path)), "'"));
    // A path without a folder is relative to the current folder. An empty folder would mean that
    // the file has no folder.
    const auto folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
    try {
      return readModel(readModelFile(file), folder, options);
    } catch (Failure& failure) {
      failure.error.message = join(inQuotes(utf8(path.filename())), ": ", failure.error.message);
      throw;
    }
  });
}

}  // namespace dermis::gltf
