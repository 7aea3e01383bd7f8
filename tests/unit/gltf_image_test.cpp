// Images of base colors: where they come from, and that a wrong one costs no more than itself.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "gltf_builder.h"
#include "temporary_folder.h"

namespace dermis::test {
namespace {

/// The triangle with a texture whose image is the given JSON.
FileBuilder textured(const Json& image) {
  FileBuilder file = skinnedTriangle();
  file.primitive()["material"] = 0;
  file.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  file.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  file.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}}};
  file.json["images"] = Json::array({image});
  return file;
}

gltf::Model loadedWithImages(const FileBuilder& file, const std::filesystem::path& folder = {}) {
  return loaded(gltf::loadFromMemory(bytesOf(file.text()), folder, {.images = true}));
}

std::string imageText(const gltf::Model& model) {
  std::string text;
  for (const std::byte byte : model.images.at(0).bytes) text += static_cast<char>(byte);
  return text;
}

TEST(GltfImageTest, AreNotReadUnlessWanted) {
  const gltf::Model model = loaded(textured({{"uri", "data:;base64,YWJj"}}));
  EXPECT_TRUE(model.images.empty());
  EXPECT_EQ(model.materials.at(0).baseColorTexture.image, noIndex);
}

TEST(GltfImageTest, ComeFromDataUris) {
  const gltf::Model model =
      loadedWithImages(textured({{"uri", "data:image/png;base64,YWJj"}, {"name", "skin"}}));
  EXPECT_EQ(imageText(model), "abc");
  EXPECT_EQ(model.images[0].name, "image 0 'skin'");
  const gltf::Material::Texture& use = model.materials.at(0).baseColorTexture;
  EXPECT_EQ(use.image, 0u);
  EXPECT_EQ(use.texcoord, 0u);
  EXPECT_EQ(use.wrapU, gltf::Material::Wrap::clampToEdge);
  EXPECT_EQ(use.wrapV, gltf::Material::Wrap::mirroredRepeat);
  EXPECT_TRUE(model.notes.empty());
}

TEST(GltfImageTest, ComeFromBufferViews) {
  FileBuilder file = textured({{"mimeType", "image/png"}});
  file.json["images"][0]["bufferView"] = file.addView(bytesOf("abcdef"));
  EXPECT_EQ(imageText(loadedWithImages(file)), "abcdef");
}

TEST(GltfImageTest, ComeFromFilesInTheFolderAlone) {
  const TemporaryFolder folder;
  folder.write("inside/skin.png", std::string("picture"));
  folder.write("secret.png", std::string("secret"));
  const gltf::Model found = loadedWithImages(textured({{"uri", "skin.png"}}), folder / "inside");
  EXPECT_EQ(imageText(found), "picture");
  const std::string absolute = (folder / "secret.png").string();
  std::error_code notMade;  // without symbolic links, the file is just missing
  std::filesystem::create_symlink("../secret.png", folder / "inside" / "link.png", notMade);
  for (const std::string& uri : std::vector<std::string>{
           "../secret.png", absolute, "link.png", "absent.png", "https://example.org/a.png", "%"}) {
    SCOPED_TRACE(uri);
    const gltf::Model model = loadedWithImages(textured({{"uri", uri}}), folder / "inside");
    EXPECT_TRUE(model.images.at(0).bytes.empty());
    EXPECT_EQ(model.materials.at(0).baseColorTexture.image, noIndex);
    EXPECT_EQ(model.notes.size(), 1u);
  }
}

TEST(GltfImageTest, WrongOnesCostAPictureAndNoMore) {
  for (const Json& image :
       {Json::object(), Json{{"uri", 5}}, Json{{"bufferView", 1000}}, Json{{"bufferView", -1}},
        Json{{"bufferView", "x"}}, Json{{"uri", "data:;base64,%%%"}}, Json(7), Json(nullptr)}) {
    SCOPED_TRACE(image.dump());
    const gltf::Model model = loadedWithImages(textured(image));
    EXPECT_EQ(model.materials.at(0).baseColorTexture.image, noIndex);
    EXPECT_EQ(model.notes.size(), 1u);
  }
}

TEST(GltfImageTest, WrongTexturesAreNone) {
  const Json image = {{"uri", "data:;base64,YWJj"}};
  const auto expectNone = [](const FileBuilder& file) {
    EXPECT_EQ(loadedWithImages(file).materials.at(0).baseColorTexture.image, noIndex)
        << file.text();
  };
  for (const char* section : {"textures", "images"}) {
    for (const Json& wrong : {Json(), Json(1), Json("x"), Json::array(), Json::object()}) {
      FileBuilder file = textured(image);
      file.json[section] = wrong;
      expectNone(file);
    }
  }
  for (const Json& wrong : {Json(1), Json(-1), Json("x"), Json()}) {
    FileBuilder file = textured(image);
    file.json["textures"][0]["source"] = wrong;
    expectNone(file);
  }
  FileBuilder file = textured(image);
  file.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 9}};
  expectNone(file);
}

}  // namespace
}  // namespace dermis::test
