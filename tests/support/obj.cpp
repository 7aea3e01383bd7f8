#include "obj.h"

#include <cstdlib>
#include <fstream>
#include <regex>
#include <sstream>

namespace dermis::test {
namespace {

/// The words of a line, one space between them.
std::vector<std::string> wordsOf(const std::string& line) {
  std::vector<std::string> words;
  std::istringstream stream(line);
  for (std::string word; std::getline(stream, word, ' ');) words.push_back(word);
  return words;
}

template <std::size_t size>
bool readNumbers(const std::vector<std::string>& words, std::vector<std::array<float, size>>& all) {
  if (words.size() != size + 1) return false;
  std::array<float, size>& numbers = all.emplace_back();
  for (std::size_t i = 0; i < size; ++i) {
    char* end = nullptr;
    numbers[i] = std::strtof(words[i + 1].c_str(), &end);
    if (end == words[i + 1].c_str() || *end != '\0') return false;
  }
  return true;
}

bool readFace(const std::vector<std::string>& words, const Obj& obj, ObjObject& object) {
  static const std::regex form("([1-9][0-9]*)/([1-9][0-9]*)?/([1-9][0-9]*)");
  if (words.size() != 4) return false;
  std::array<ObjCorner, 3>& face = object.faces.emplace_back();
  for (std::size_t i = 0; i < 3; ++i) {
    std::smatch match;
    if (!std::regex_match(words[i + 1], match, form)) return false;
    face[i].position = std::stoul(match[1]) - 1;
    face[i].normal = std::stoul(match[3]) - 1;
    if (match[2].matched) face[i].texcoord = std::stoul(match[2]) - 1;
    if (face[i].position < object.firstPosition || face[i].position >= obj.positions.size() ||
        face[i].normal >= obj.normals.size() ||
        face[i].texcoord.value_or(0) >= obj.texcoords.size() + 1 ||
        face[i].texcoord.has_value() != (object.texcoords != 0)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::optional<Obj> readObj(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  Obj obj;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("#")) continue;
    const std::vector<std::string> words = wordsOf(line);
    if (words.empty()) return std::nullopt;
    bool good = false;
    if (words[0] == "o") {
      good = words.size() == 2 && !words[1].empty();
      if (good) obj.objects.push_back({words[1], obj.positions.size(), 0, 0, 0, {}});
    } else if (obj.objects.empty()) {
      return std::nullopt;
    } else if (words[0] == "v") {
      good = readNumbers(words, obj.positions);
      ++obj.objects.back().positions;
    } else if (words[0] == "vt") {
      good = readNumbers(words, obj.texcoords);
      ++obj.objects.back().texcoords;
    } else if (words[0] == "vn") {
      good = readNumbers(words, obj.normals);
      ++obj.objects.back().normals;
    } else if (words[0] == "f") {
      good = readFace(words, obj, obj.objects.back());
    }
    if (!good) return std::nullopt;
  }
  return obj;
}

}  // namespace dermis::test
