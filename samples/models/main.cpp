// dermis-models OUTDIR: writes bar.glb, arm.glb and figure.glb into an existing folder.
#include <string>

#include "models.h"
#include "program/file_name.h"
#include "program/output_file.h"
#include "program/program.h"

namespace {

using namespace dermis;
using samples::ExitStatus;

ExitStatus run(int argumentCount, char** arguments) {
  if (argumentCount != 2)
    return samples::reportError(ExitStatus::wrongUsage, "usage: dermis-models OUTDIR");
  const std::string folder = arguments[1];
  const struct {
    const char* name;
    std::vector<std::byte> (*make)();
  } files[] = {{"bar.glb", models::makeBar},
               {"arm.glb", models::makeArm},
               {"figure.glb", models::makeFigure}};
  for (const auto& [name, make] : files) {
    if (Result<void> written = samples::writeFile(samples::pathOf(folder + "/" + name), make());
        !written)
      return samples::reportError(ExitStatus::stopped, written.error().message);
  }
  return ExitStatus::done;
}

}  // namespace

int main(int argumentCount, char** arguments) {
  return samples::runProgram("dermis-models", argumentCount, arguments, run);
}
