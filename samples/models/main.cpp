// dermis-models OUTDIR: writes bar.glb, arm.glb and figure.glb into an existing folder.
#include <cstdio>
#include <exception>
#include <fstream>
#include <string>

#include "models.h"

namespace {

constexpr int wrongUsage = 2;
constexpr int failed = 5;

bool writeFile(const std::string& path, const std::vector<std::byte>& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) std::fprintf(stderr, "dermis-models: error: cannot write '%s'\n", path.c_str());
  return static_cast<bool>(file);
}

}  // namespace

int main(int argumentCount, char** arguments) {
  if (argumentCount != 2) {
    std::fprintf(stderr, "usage: dermis-models OUTDIR\n");
    return wrongUsage;
  }
  try {
    const std::string folder = arguments[1];
    const bool written = writeFile(folder + "/bar.glb", dermis::models::makeBar()) &&
                         writeFile(folder + "/arm.glb", dermis::models::makeArm()) &&
                         writeFile(folder + "/figure.glb", dermis::models::makeFigure());
    return written ? 0 : failed;
  } catch (const std::exception& exception) {
    std::fprintf(stderr, "dermis-models: error: %s\n", exception.what());
    return failed;
  }
}
