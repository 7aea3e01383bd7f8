// Where the bytes come from: data URIs, and files beside the glTF file and nowhere else.
#ifndef _WIN32
#include <sys/stat.h>
#endif
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "gltf/buffers.h"
#include "gltf_builder.h"
#include "temporary_folder.h"

namespace dermis::test {
namespace {

class GltfBuffer : public testing::Test {
 protected:
  GltfBuffer() { std::filesystem::create_directories(folder_ / "inside" / "deeper"); }

  void write(const std::string& name, const std::vector<std::byte>& bytes) const {
    folder_.write(name, bytes);
  }

  /// Whether a symbolic link can be made: not on every system, nor by everybody.
  bool canLink() const {
    std::error_code error;
    std::filesystem::create_symlink("inside", folder_ / "probe", error);
    return !error;
  }

  TemporaryFolder folder_;
};

constexpr bool isWindows = std::filesystem::path::preferred_separator != '/';

FileBuilder withUri(const std::string& uri) {
  FileBuilder file = skinnedTriangle();
  file.json["buffers"] = {{{"byteLength", file.binary.size()}, {"uri", uri}}};
  return file;
}

TEST_F(GltfBuffer, ReadsFilesInsideTheFolder) {
  const auto bytes = skinnedTriangle().binary;
  write("inside/plain.bin", bytes);
  write("inside/with space.bin", bytes);
  write("inside/gr\xc3\xbcn.bin", bytes);
  write("inside/deeper/below.bin", bytes);
  for (const char* uri :
       {"plain.bin", "./plain.bin", "deeper/../plain.bin", "no/../plain.bin", "with%20space.bin",
        "with space.bin", "gr%C3%BCn.bin", "gr\xc3\xbcn.bin", "deeper/below.bin"}) {
    EXPECT_EQ(loaded(withUri(uri).load(folder_ / "inside")).skinnedPrimitives.size(), 1u) << uri;
  }
}

// On Windows it means a drive, or another stream of a file.
TEST_F(GltfBuffer, AColonBelongsToANameOrIsRefused) {
  write(isWindows ? "inside/a" : "inside/a:b.bin", skinnedTriangle().binary);
  if (isWindows) {
    for (const char* uri : {"./a:b.bin", "./a::$DATA", "./C:/a.bin"}) {
      expectError(withUri(uri).load(folder_ / "inside"), ErrorCode::ioError,
                  "is not a relative file name");
    }
  } else {
    loaded(withUri("./a:b.bin").load(folder_ / "inside"));
  }
}

TEST_F(GltfBuffer, OpensNothingOutsideTheFolder) {
  const auto bytes = skinnedTriangle().binary;
  write("outside.bin", bytes);
  const std::string absolute = (folder_ / "outside.bin").generic_string();
  for (const std::string& uri :
       {std::string("../outside.bin"), std::string("%2e%2e/outside.bin"), std::string(".."),
        std::string("%2e%2e%2foutside.bin"), std::string("deeper/../../outside.bin")}) {
    expectError(withUri(uri).load(folder_ / "inside"), ErrorCode::ioError,
                "outside the file's folder");
  }
  for (const auto& [uri, reason] :
       {std::pair("..\\outside.bin", "'..\\outside.bin' contains a backslash"),
        {"deeper\\below.bin", "contains a backslash; in a URI, a slash separates folders"},
        {"", "'' is not a file name"},
        {"plain.bin%00", "contains a zero byte"}}) {
    expectError(withUri(uri).load(folder_ / "inside"), ErrorCode::ioError, reason);
  }
  for (const std::string& uri :
       {absolute, "%2f" + absolute.substr(1), std::string("file:///etc/passwd"),
        std::string("http://example.com/a.bin"), std::string("C:/a.bin")}) {
    expectError(withUri(uri).load(folder_ / "inside"), ErrorCode::ioError,
                "is not a relative file name");
  }
}

// A link that stays in the folder is as good as the file.
TEST_F(GltfBuffer, FollowsLinksInsideTheFolderAlone) {
  if (!canLink()) GTEST_SKIP() << "no symbolic link can be made here";
  const auto bytes = skinnedTriangle().binary;
  write("outside.bin", bytes);
  write("inside/plain.bin", bytes);
  write("inside/deeper/below.bin", bytes);
  const auto link = [this](const char* target, const char* name) {
    std::filesystem::create_symlink(target, folder_ / "inside" / name);
  };
  link("plain.bin", "good.bin");
  link("deeper", "good");
  link("../inside/deeper/below.bin", "around.bin");
  link("../outside.bin", "bad.bin");
  link("..", "up");
  link("/proc/self", "self");
  link("bad.bin", "twice.bin");
  for (const char* uri : {"good.bin", "good/below.bin", "around.bin"})
    EXPECT_EQ(loaded(withUri(uri).load(folder_ / "inside")).skinnedPrimitives.size(), 1u) << uri;
  for (const char* uri : {"bad.bin", "up/outside.bin", "twice.bin", "self/environ"}) {
    expectError(withUri(uri).load(folder_ / "inside"), ErrorCode::ioError,
                "leads outside the file's folder through a symbolic link");
  }
  // An absolute link into the folder stays inside too.
  std::filesystem::create_symlink(
      std::filesystem::canonical(folder_ / ".") / "inside" / "plain.bin",
      folder_ / "inside" / "absolute.bin");
  loaded(withUri("absolute.bin").load(folder_ / "inside"));
  // A folder that is reached by a link is the folder.
  std::filesystem::create_directory_symlink("inside", folder_ / "linked");
  loaded(withUri("plain.bin").load(folder_ / "linked"));
}

// A model that is a link: its folder is where the link stands, as the user named it.
TEST_F(GltfBuffer, TheFolderIsThatOfThePathAsGiven) {
  if (!canLink()) GTEST_SKIP() << "no symbolic link can be made here";
  const FileBuilder file = withUri("side.bin");
  write("inside/deeper/side.bin", file.binary);
  write("inside/deeper/model.gltf", bytesOf(file.text()));
  std::filesystem::create_symlink("deeper/model.gltf", folder_ / "inside" / "link.gltf");
  expectError(gltf::load(folder_ / "inside" / "link.gltf"), ErrorCode::ioError, "there is no file");
  write("inside/side.bin", file.binary);
  loaded(gltf::load(folder_ / "inside" / "link.gltf"));
}

TEST_F(GltfBuffer, SaysWhatStandsWhereAFileShould) {
  const auto refused = [&](const std::string& name, const std::string& text) {
    expectError(withUri(name).load(folder_), ErrorCode::ioError, text);
    expectError(gltf::load(folder_ / name), ErrorCode::ioError, text);
  };
  refused("inside", "inside' is a folder");
  refused("absent.bin", "there is no file '");
#ifndef _WIN32
  const std::filesystem::path pipe = folder_ / "pipe.bin";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  refused("pipe.bin", "pipe.bin' is a pipe, a socket or a device, not a file");
  std::filesystem::create_symlink("loop.bin", folder_ / "loop.bin");
  refused("loop.bin", "loop.bin' cannot be opened: Too many levels of symbolic links");
  if (geteuid() == 0) return;  // who may read everything
  write("secret.bin", skinnedTriangle().binary);
  std::filesystem::permissions(folder_ / "secret.bin", std::filesystem::perms::none);
  refused("secret.bin", "secret.bin' cannot be opened: Permission denied");
#endif
}

TEST_F(GltfBuffer, NamesAFileThatIsMissing) {
  expectError(withUri("missing.bin").load(folder_), ErrorCode::ioError,
              "buffer 0: there is no file");
  expectError(withUri("missing.bin").load(folder_), ErrorCode::ioError, "missing.bin");
  expectError(withUri("inside").load(folder_), ErrorCode::ioError, "inside' is a folder");
  expectError(withUri("missing.bin").load(), ErrorCode::ioError, "without a folder");
  expectError(withUri("a%2").load(folder_), ErrorCode::invalidData, "a '%' without two digits");
}

TEST_F(GltfBuffer, RefusesAFileThatIsTooShort) {
  auto bytes = skinnedTriangle().binary;
  bytes.pop_back();
  write("short.bin", bytes);
  expectError(withUri("short.bin").load(folder_), ErrorCode::invalidData,
              "accessor 2: bytes 0 to 48 are outside bufferView 2 of 47 bytes");
  // Unless what is missing is not needed.
  FileBuilder file = withUri("short.bin");
  file.json["bufferViews"].push_back({{"buffer", 0}, {"byteLength", 1}});
  file.json["buffers"][0]["byteLength"] = file.binary.size() + 3;
  write("short.bin", file.binary);
  const gltf::Model model = loaded(file.load(folder_));
  EXPECT_TRUE(hasNote(model, "buffer 0: byteLength is 99, but there are only 96 bytes"))
      << testing::PrintToString(model.notes);
  expectError(file.load(folder_, {.strict = true}), ErrorCode::invalidData,
              "buffer 0: byteLength is 99, but there are only 96 bytes");
  // One that is longer is read as far as the byteLength goes.
  bytes.resize(bytes.size() + 1000);
  write("long.bin", bytes);
  loaded(withUri("long.bin").load(folder_));
}

TEST_F(GltfBuffer, LoadsAPathAndItsSideFiles) {
  const FileBuilder file = withUri("side.bin");
  write("side.bin", file.binary);
  write("model.gltf", bytesOf(file.text()));
  EXPECT_EQ(loaded(gltf::load(folder_ / "model.gltf")).skinnedPrimitives.size(), 1u);

  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  EXPECT_EQ(loaded(gltf::load("model.gltf")).skinnedPrimitives.size(), 1u);
  std::filesystem::current_path(before);

  expectError(gltf::load(folder_ / "absent.gltf"), ErrorCode::ioError, "absent.gltf");
  expectError(gltf::load(folder_), ErrorCode::ioError, "is a folder");
  write("broken.gltf", bytesOf("{"));
  expectError(gltf::load(folder_ / "broken.gltf"), ErrorCode::invalidData, "'broken.gltf': ");
}

TEST_F(GltfBuffer, ReadsDataUris) {
  const FileBuilder file = skinnedTriangle();
  const std::string base64 = encodeBase64(file.binary);
  std::string percent;
  for (const std::byte byte : file.binary) {
    const char* digits = "0123456789abcdef";
    const auto value = std::to_integer<unsigned>(byte);
    percent += {'%', digits[value >> 4], digits[value & 15]};
  }
  for (const std::string& uri :
       {"data:application/octet-stream;base64," + base64,
        "data:application/gltf-buffer;base64," + base64, "data:;base64," + base64,
        "data:text/plain;charset=utf-8;base64," + base64, "data:," + percent}) {
    EXPECT_EQ(firstPrimitive(loaded(withUri(uri))).positions[3], 1.0f) << uri.substr(0, 40);
  }
}

// What `fetch` of browsers decodes: https://fetch.spec.whatwg.org/#data-urls.
TEST_F(GltfBuffer, DecodesDataUrisAsBrowsersDo) {
  std::vector<std::byte> all;
  for (int value = 0; value < 256; ++value) all.push_back(static_cast<std::byte>(value));
  const std::string base64 = encodeBase64(all);
  ASSERT_TRUE(base64.ends_with("=="));
  std::string escaped, wrapped;
  for (std::size_t i = 0; i < base64.size(); ++i) {
    const char character = base64[i];
    escaped += character == '+'   ? "%2B"
               : character == '/' ? "%2f"
               : character == '=' ? "%3D"
                                  : std::string(1, character);
    wrapped += character;
    if (i % 76 == 75) wrapped += "\r\n\t ";
  }
  for (const std::string& uri :
       {"data:;base64," + base64, "DATA:Application/Octet-Stream;BASE64," + base64,
        "Data:;Base64 ," + base64, "data:;base64," + escaped, "data:;base64," + wrapped + "\n",
        "data:;base64,%20" + wrapped + "%0A", "data:;base64," + base64 + "#fragment"}) {
    EXPECT_EQ(gltf::decodeDataUri(uri, "it"), all) << uri.substr(0, 40);
    EXPECT_TRUE(gltf::isDataUri(uri));
  }
  EXPECT_EQ(gltf::decodeDataUri("data:base64,AA%3d", "it"), bytesOf(std::string("AA=")))
      << "without a semicolon it is a media type";
  EXPECT_FALSE(gltf::isDataUri("data.bin"));
  const std::string binary = encodeBase64(skinnedTriangle().binary);
  EXPECT_EQ(firstPrimitive(loaded(withUri("DATA:;BASE64," + binary))).positions[3], 1.0f);
}

TEST_F(GltfBuffer, RefusesBrokenDataUris) {
  expectInvalid(withUri("data:application/octet-stream;base64"), "has no comma");
  expectInvalid(withUri("data:;base64,AAAA*AAA"), "character 4 of its data URI is not base64");
  expectInvalid(withUri("data:;base64,AAAA==AA"), "is not base64");
  expectInvalid(withUri("data:;base64,AAAAA"), "is truncated");
  expectInvalid(withUri("data:;base64,AAAA==="), "is not base64");
  expectInvalid(withUri("data:;base64,AA%3"), "a '%' without two digits");
  expectInvalid(withUri("data:;base64#,AAAA"), "has no comma");
  expectInvalid(withUri("data:;base64,AAAA"), "are outside bufferView 0 of 3 bytes");
  expectInvalid(withUri("data:,%zz"), "a '%' without two digits");
}

TEST_F(GltfBuffer, TellsWhenABufferIsNowhere) {
  FileBuilder file = skinnedTriangle();
  file.json["buffers"] = {{{"byteLength", file.binary.size()}}};
  expectInvalid(file, "buffer 0: it has no uri, and the file has no binary chunk for it");
}

TEST_F(GltfBuffer, NotesABinaryChunkThatIsTooShort) {
  FileBuilder file = skinnedTriangle();
  auto bytes = file.glb();
  const std::string length = "\"byteLength\":" + std::to_string(file.binary.size()) + "}]";
  const std::string longer = "\"byteLength\":" + std::to_string(file.binary.size() + 3) + "}]";
  ASSERT_EQ(length.size(), longer.size());
  const auto found =
      std::search(bytes.begin(), bytes.end(), length.begin(), length.end(),
                  [](std::byte a, char b) { return a == static_cast<std::byte>(b); });
  ASSERT_NE(found, bytes.end());
  std::transform(longer.begin(), longer.end(), found,
                 [](char character) { return static_cast<std::byte>(character); });
  EXPECT_EQ(expectNoted(bytes, "buffer 0: byteLength is 99, but there are only 96 bytes")
                .skinnedPrimitives.size(),
            1u);
}

// A buffer that only static meshes, images or nothing at all use need not be there.
TEST_F(GltfBuffer, ReadsPastABufferThatNothingSkinnedUses) {
  FileBuilder file = skinnedTriangle();
  file.json["buffers"] = {
      {{"byteLength", file.binary.size()}, {"uri", "data:;base64," + encodeBase64(file.binary)}},
      {{"byteLength", 100}, {"uri", "missing.bin"}}};
  file.json["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 24}});
  file.attributes()["TEXCOORD_0"] = file.addAccessor(
      {{"bufferView", 3}, {"componentType", floatType}, {"count", 3}, {"type", "VEC2"}});
  const gltf::Model model = loaded(file.load(folder_));
  EXPECT_TRUE(firstPrimitive(model).texcoords.empty());
  EXPECT_TRUE(hasNote(model, "buffer 1: there is no file")) << testing::PrintToString(model.notes);
  EXPECT_TRUE(hasNote(model, "accessor 3: it is invalid, or its data is missing; it is left out"));
  expectError(file.load(folder_, {.strict = true}), ErrorCode::ioError, "buffer 1: there is no");
  file.attributes()["POSITION"] = 3;
  expectError(file.load(folder_), ErrorCode::ioError, "buffer 1: there is no file");
}

TEST_F(GltfBuffer, RefusesBadDescriptions) {
  FileBuilder file = withUri("x.bin");
  file.json["buffers"][0]["uri"] = 4;
  expectInvalid(file, "buffer 0: uri is not a string");
  file.json["buffers"][0].erase("byteLength");
  expectInvalid(file, "buffer 0: it has no byteLength");
  file.json["buffers"][0] = {{"byteLength", 0}, {"uri", "data:,"}};
  expectInvalid(file, "accessor 0: bytes 0 to 36 are outside bufferView 0 of 0 bytes");
}

}  // namespace
}  // namespace dermis::test
