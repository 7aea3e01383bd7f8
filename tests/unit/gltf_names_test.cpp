// Names from files in messages: cut at 80 characters and on one line, wherever a message has one.
#include <functional>

#include "gltf_builder.h"
#include "temporary_folder.h"

namespace dermis::test {
namespace {

using File = FileBuilder;

struct Place {
  const char* what;
  std::function<void(File&, const std::string& name)> put;
};

void setUri(File& file, const std::string& uri) {
  file.json["buffers"] = {{{"byteLength", file.binary.size()}, {"uri", uri}}};
}

/// Every place where a message may have text from the file.
const std::vector<Place>& places() {
  static const std::vector<Place> all{
      {"uri", setUri},
      {"uri in a folder", [](File& f, const std::string& n) { setUri(f, "inside/" + n); }},
      {"uri of a URL", [](File& f, const std::string& n) { setUri(f, "http://" + n); }},
      {"uri outside", [](File& f, const std::string& n) { setUri(f, "../" + n); }},
      {"uri with a backslash", [](File& f, const std::string& n) { setUri(f, n + "\\"); }},
      {"uri with a zero", [](File& f, const std::string& n) { setUri(f, n + "%00"); }},
      {"absolute uri", [](File& f, const std::string& n) { setUri(f, "/" + n); }},
      {"uri of many folders",
       [](File& f, const std::string& n) {
         std::string uri = n.substr(0, 100);
         for (int i = 0; i < 1000; ++i) uri += "/folder";
         setUri(f, uri);
       }},
      {"uri of an image",
       [](File& f, const std::string& n) {
         f.json["images"] = {{{"uri", n}, {"name", n}}};
         f.json["textures"] = {{{"source", 0}}};
         f.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
       }},
      {"version", [](File& f, const std::string& n) { f.json["asset"]["version"] = n; }},
      {"minVersion", [](File& f, const std::string& n) { f.json["asset"]["minVersion"] = n; }},
      {"minVersion, an array",
       [](File& f, const std::string& n) { f.json["asset"]["minVersion"] = {n}; }},
      {"required extension",
       [](File& f, const std::string& n) { f.json["extensionsRequired"] = {n}; }},
      {"required extension that is not used",
       [](File& f, const std::string& n) { f.json["extensionsRequired"] = {"KHR_texture_" + n}; }},
      {"null", [](File& f, const std::string& n) { f.json["nodes"][0][n] = nullptr; }},
      {"attribute of no accessor",
       [](File& f, const std::string& n) { f.attributes()["_" + n] = 99; }},
      {"joints of no number",
       [](File& f, const std::string& n) { f.attributes()["JOINTS_" + n] = 1; }},
      {"texture coordinates of a wrong type",
       [](File& f, const std::string& n) { f.attributes()["TEXCOORD_" + n] = 0; }},
      {"attribute of another count",
       [](File& f, const std::string& n) {
         f.attributes()["_" + n] = f.addFloats({1, 2}, "SCALAR");
       }},
      {"type", [](File& f, const std::string& n) { f.accessor("POSITION")["type"] = n; }},
      {"interpolation",
       [](File& f, const std::string& n) {
         f.json["animations"] = {
             {{"samplers", {{{"input", 0}, {"output", 0}, {"interpolation", n}}}},
              {"channels", Json::array()}}};
       }},
      {"name of a mesh",
       [](File& f, const std::string& n) {
         f.json["meshes"][0]["name"] = n;
         f.attributes().erase("JOINTS_0");
         f.attributes().erase("WEIGHTS_0");
       }},
  };
  return all;
}

/// All that is said of the file.
std::vector<std::string> messagesOf(const File& file, const std::filesystem::path& folder,
                                    bool strict) {
  const Result<gltf::Model> result = file.load(folder, {.images = true, .strict = strict});
  if (!result) return {result.error().message};
  std::vector<std::string> messages = result->notes;
  for (const gltf::Mesh& mesh : result->meshes)
    for (const gltf::Primitive& primitive : mesh.primitives) messages.push_back(primitive.name);
  return messages;
}

TEST(GltfNames, AreCutInEveryMessage) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "inside");
  const std::string name = "\x1b[31m\xe2\x80\xae" + std::string(100'000, 'N');
  for (const Place& place : places()) {
    SCOPED_TRACE(place.what);
    FileBuilder file = skinnedTriangle();
    place.put(file, name);
    bool isShown = false;
    for (const std::filesystem::path& where : {std::filesystem::path(), folder / "."}) {
      for (const bool strict : {false, true}) {
        const std::vector<std::string> messages = messagesOf(file, where, strict);
        EXPECT_FALSE(messages.empty());
        for (const std::string& message : messages) {
          EXPECT_LT(message.size(), 400u);
          EXPECT_EQ(message.find('\x1b'), std::string::npos);
          EXPECT_EQ(message.find("\xe2\x80\xae"), std::string::npos);
          isShown = isShown || message.find("\\u001b[31m\\u202eNNN") != std::string::npos;
        }
      }
    }
    EXPECT_TRUE(isShown) << "the row does not show what it should";
  }
}

// The path that the user gave is not from the file.
TEST(GltfNames, ThePathOfTheModelIsPrintedInFull) {
  std::string path(200, 'p');
  path[100] = '/';
  expectError(gltf::load(path), ErrorCode::ioError, "there is no file '" + path + "'");
}

}  // namespace
}  // namespace dermis::test
