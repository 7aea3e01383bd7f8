// How much memory a file may take: 64 MiB and 64 times the bytes of all its files, each counted
// once. What would be more is refused before it is made.
#include "gltf/memory_budget.h"

#include <cstddef>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "gltf/failure.h"
#include "gltf_builder.h"
#include "temporary_folder.h"

namespace dermis::test {
namespace {

using gltf::MemoryBudget;

TEST(MemoryBudgetTest, IsSpentWholeOrNotAtAll) {
  MemoryBudget budget;
  EXPECT_EQ(budget.left(), std::uint64_t{64} << 20);
  budget.addFile(1000);
  EXPECT_EQ(budget.left(), (std::uint64_t{64} << 20) + 64'000);
  EXPECT_FALSE(budget.spend(budget.left() + 1));
  EXPECT_FALSE(budget.spend(budget.left() / 8 + 1, 8));
  EXPECT_TRUE(budget.spend(1000, 64));
  EXPECT_EQ(budget.left(), std::uint64_t{64} << 20);
  EXPECT_TRUE(budget.spend(budget.left()));
  EXPECT_TRUE(budget.spend(0));
  EXPECT_FALSE(budget.spend(1));
}

TEST(MemoryBudgetTest, ProductsDoNotWrap) {
  MemoryBudget budget;
  EXPECT_FALSE(budget.spend(std::uint64_t{1} << 32, std::uint64_t{1} << 32));
  EXPECT_FALSE(budget.spend(~std::uint64_t{0}, 2));
  budget.addFile(~std::uint64_t{0});
  EXPECT_GT(budget.left(), std::uint64_t{1} << 61);
}

// However much the budget has: on a 32-bit system these sizes would be counted modulo 2^32.
TEST(MemoryBudgetTest, NothingIsLargerThanAnObjectCanBe) {
  constexpr std::uint64_t largest = std::numeric_limits<std::ptrdiff_t>::max();
  for (const std::uint64_t bytesEach : {1u, 4u, 48u}) {
    MemoryBudget budget;
    budget.addFile(~std::uint64_t{0});
    EXPECT_THROW(gltf::spend(budget, largest / bytesEach + 1, bytesEach, "it"), gltf::Failure);
    if (sizeof(std::size_t) == 4) {
      EXPECT_NO_THROW(gltf::spend(budget, largest / bytesEach, bytesEach, "it"));
    }
  }
}

class GltfBudget : public testing::Test {
 protected:
  /// All zeros; sparse, where the file system can.
  std::filesystem::path writeSparse(const std::string& name, const std::string& start,
                                    std::uint64_t size) const {
    const std::filesystem::path path = folder_.write(name, start);
    std::error_code error;
    std::filesystem::resize_file(path, size, error);
    return error ? std::filesystem::path() : path;
  }

  TemporaryFolder folder_;
};

/// What a file of so many bytes may take in all.
std::uint64_t allowed(std::uint64_t bytes) {
  return MemoryBudget::base + MemoryBudget::perByte * bytes;
}

Json sideBuffers(std::size_t count, std::uint64_t byteLength, const char* uri) {
  return std::vector<Json>(count, {{"byteLength", byteLength}, {"uri", uri}});
}

TEST_F(GltfBudget, ReadsAndCountsAFileThatManyBuffersNameOnce) {
  constexpr std::uint64_t size = 1'000'000;
  writeSparse("side.bin", "", size);
  FileBuilder file = skinnedTriangle();
  file.json["buffers"] = sideBuffers(400, size, "side.bin");
  file.json["buffers"][7]["uri"] = "./side.bin";
  file.json["buffers"][8]["byteLength"] = 1000;
  const gltf::Model model = loaded(file.load(folder_));
  const std::uint64_t all = allowed(file.text().size() + size);
  EXPECT_LE(model.memoryLeft, all) << "its bytes raise the budget once";
  EXPECT_GE(model.memoryLeft, all - 3 * size) << "and are spent once";
}

TEST_F(GltfBudget, ReadsASideFileAsFarAsItIsNeeded) {
  FileBuilder file = skinnedTriangle();
  if (writeSparse("side.bin", "", std::uint64_t{100} << 30).empty()) GTEST_SKIP() << "not sparse";
  file.json["buffers"] = sideBuffers(1, file.binary.size(), "side.bin");
  const gltf::Model model = loaded(file.load(folder_));
  EXPECT_LE(model.memoryLeft, allowed(file.text().size() + file.binary.size()));
  file.json["buffers"] = sideBuffers(1, std::uint64_t{100} << 30, "side.bin");
  expectError(file.load(folder_), ErrorCode::limitExceeded,
              "buffer 0: the file has 107374182400 bytes");
}

TEST_F(GltfBudget, LooksAtTheHeaderBeforeItReadsTheRest) {
  constexpr std::uint64_t size = std::uint64_t{1} << 40;
  const auto glb = writeSparse("sparse.glb", std::string("glTF\x02\0\0\0\x00\x10\0\0", 12), size);
  if (glb.empty()) GTEST_SKIP() << "not sparse";
  // What stands behind the container is not read: but so much is no glTF file.
  const std::string maximum =
      std::string("the maximum is ") + (sizeof(std::size_t) == 4 ? "2147483647" : "4294967296");
  expectError(gltf::load(glb), ErrorCode::limitExceeded, maximum);
  expectError(gltf::load(writeSparse("sparse.gltf", " {", size)), ErrorCode::limitExceeded,
              maximum);
  expectError(gltf::load(writeSparse("zeros.gltf", "", size)), ErrorCode::invalidData,
              "invalid at byte 1");
  expectError(gltf::load(writeSparse("text.gltf", "\xef\xbb\xbf glTF", size)),
              ErrorCode::invalidData, "invalid at byte 5");
}

// The text of a data URI stands in the file already: what it decodes to raises nothing.
TEST_F(GltfBudget, DataUrisAreNotCountedTwice) {
  const FileBuilder file = skinnedTriangle();
  EXPECT_LT(loaded(file.load()).memoryLeft, allowed(file.text().size()));
}

/// A triangle without data for its accessors; `nodes` nodes of a mesh of `primitives` primitives.
FileBuilder product(std::size_t nodes, std::size_t primitives) {
  FileBuilder file = skinnedTriangle();
  for (const char* attribute : {"POSITION", "JOINTS_0", "WEIGHTS_0"})
    file.accessor(attribute).erase("bufferView");
  const Json primitive = {{"attributes", file.attributes()}};
  file.json["meshes"][0]["primitives"] = std::vector<Json>(primitives, primitive);
  for (std::size_t i = 1; i < nodes; ++i) {
    file.json["scenes"][0]["nodes"].push_back(file.json["nodes"].size());
    file.json["nodes"].push_back({{"mesh", 0}, {"skin", 0}});
  }
  return file;
}

TEST_F(GltfBudget, CountsNodesTimesPrimitivesBeforeItMakesThem) {
  EXPECT_EQ(loaded(product(100, 50)).skinnedPrimitives.size(), 5000u);
  expectError(product(4000, 4000).load(), ErrorCode::limitExceeded, "and the primitives of mesh 0");
  FileBuilder nothing = product(4000, 1);
  nothing.json["meshes"][0]["primitives"] =
      std::vector<Json>(4000, {{"attributes", Json::object()}});
  expectError(nothing.load(), ErrorCode::limitExceeded, "and the primitives of mesh 0");
}

/// `count` primitives of 20,000 vertices, each with its own accessors unless they are shared.
FileBuilder ofManyVertices(std::size_t count, bool isShared) {
  FileBuilder file = product(1, count);
  for (Json& accessor : file.json["accessors"]) accessor["count"] = 20'000;
  if (isShared) return file;
  for (std::size_t i = 1; i < count; ++i) {
    Json& attributes = file.json["meshes"][0]["primitives"][i]["attributes"];
    for (Json& attribute : attributes)
      attribute = file.addAccessor(file.json["accessors"][attribute.get<std::size_t>()]);
  }
  return file;
}

TEST_F(GltfBudget, SpendsSharedAccessorsOnce) {
  const std::uint64_t one = loaded(ofManyVertices(1, true)).memoryLeft;
  const FileBuilder file = ofManyVertices(200, true);
  const gltf::Model model = loaded(file);
  EXPECT_EQ(model.skinnedPrimitives.size(), 200u);
  EXPECT_GT(model.memoryLeft, one - 200 * 1000);
  expectError(ofManyVertices(200, false).load(), ErrorCode::limitExceeded,
              "it needs more memory than");
}

TEST_F(GltfBudget, CountsWhatIsMadeOfAText) {
  for (const char* section : {"nodes", "materials", "meshes", "skins", "animations", "accessors",
                              "bufferViews", "scenes"}) {
    FileBuilder file;
    // Pointers are smaller in 32-bit builds.
    file.json[section] = std::vector<Json>(sizeof(void*) == 4 ? 800'000 : 300'000, Json::object());
    const Result<gltf::Model> result = file.load();
    ASSERT_FALSE(result.ok()) << section;
    EXPECT_EQ(result.error().code, ErrorCode::limitExceeded) << result.error().message;
  }
}

FileBuilder texturedBy(std::size_t images) {
  FileBuilder file = skinnedTriangle();
  for (std::size_t i = 0; i < images; ++i) {
    file.json["images"].push_back({{"mimeType", "image/png"}});
    file.json["textures"].push_back({{"source", i}});
    file.json["materials"].push_back(
        {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}}});
  }
  return file;
}

gltf::Model withImages(const FileBuilder& file) {
  return loaded(gltf::loadFromMemory(file.glb(), {}, {.images = true}));
}

// The buffer needs the first half of the file, the image all of it.
TEST_F(GltfBudget, AnImageMayBeLargerThanTheBufferInItsFile) {
  constexpr std::uint64_t size = 1'000'000;
  writeSparse("side.bin", "", size);
  FileBuilder file = texturedBy(1);
  file.json["buffers"] = sideBuffers(1, size / 2, "side.bin");
  file.json["images"][0]["uri"] = "side.bin";
  const gltf::Model model =
      loaded(gltf::loadFromMemory(bytesOf(file.text()), folder_, {.images = true}));
  EXPECT_EQ(model.images.at(0).bytes.size(), size);
  const std::uint64_t all = allowed(file.text().size() + size);
  EXPECT_LE(model.memoryLeft, all) << "the first half raises the budget once";
  EXPECT_GE(model.memoryLeft, all - 4 * size);
}

TEST_F(GltfBudget, EqualImagesAreOne) {
  FileBuilder file = texturedBy(4);
  const std::size_t view = file.addView(bytesOf(std::string("picture")));
  const std::size_t copy = file.addView(bytesOf(std::string("picture")));
  file.json["images"][0]["bufferView"] = file.json["images"][1]["bufferView"] = view;
  file.json["images"][2]["bufferView"] = copy;
  file.json["images"][3]["uri"] = "data:;base64,cGljdHVyZQ==";
  const gltf::Model model = withImages(file);
  for (const gltf::Material& material : model.materials)
    EXPECT_EQ(material.baseColorTexture.image, 0u);
  EXPECT_EQ(model.images.at(0).bytes.size(), 7u);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_TRUE(model.images[i].bytes.empty()) << i;
}

TEST_F(GltfBudget, LeavesImagesOutThatAreTooMuch) {
  constexpr std::size_t count = 300, size = 1'000'000;
  FileBuilder file = texturedBy(count);
  const std::size_t view = file.addView(std::vector<std::byte>(size + 5 * count));
  for (std::size_t i = 0; i < count; ++i) {
    Json part = file.json["bufferViews"][view];
    part["byteOffset"] = part["byteOffset"].get<std::size_t>() + 4 * i;
    part["byteLength"] = size + i;  // no two are equal
    file.json["images"][i]["bufferView"] = file.json["bufferViews"].size();
    file.json["bufferViews"].push_back(part);
  }
  const gltf::Model model = withImages(file);
  std::size_t shown = 0;
  for (const gltf::Image& image : model.images) shown += image.bytes.empty() ? 0u : 1u;
  EXPECT_GT(shown, 50u);
  EXPECT_LT(shown, 150u) << "a budget of 64 MiB and 64 times 1 MB";
  EXPECT_TRUE(hasNote(model, "a file of this size; it is left out (and " +
                                 std::to_string(count - shown - 1) + " more of this kind)"))
      << testing::PrintToString(model.notes);
}

}  // namespace
}  // namespace dermis::test
