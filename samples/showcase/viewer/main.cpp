// dermis_viewer: shows a skinned model in a window, with any method and its cost.

#include <string>

#include "kit/program.h"
#include "options.h"
#include "presenter.h"
#include "viewer.h"

namespace {

using namespace dermis;
using samples::ExitStatus;

/// Messages of the validation layer make the program fail.
ExitStatus reportValidation(samples::Device& device, ExitStatus status) {
  for (const std::string& message : device.takeValidationMessages())
    status = samples::reportError(ExitStatus::stopped, message);
  return status;
}

ExitStatus run(int argc, char** argv) {
  viewer::Options options;
  if (const auto ended = viewer::readOptions(argc, argv, options)) return *ended;
  const Result<std::unique_ptr<viewer::Presenter>> presenter = viewer::Presenter::create(options);
  if (!presenter) return samples::reportDeviceError(presenter.error());
  ExitStatus status = ExitStatus::done;
  {
    viewer::Viewer program(options, **presenter);
    const Result<ExitStatus> done = program.run();
    status = done ? *done : samples::reportError(ExitStatus::stopped, done.error().message);
  }
  return reportValidation(*(*presenter)->device().device, status);
}

}  // namespace

int main(int argc, char** argv) {
  return samples::runProgram("dermis_viewer", argc, argv, run);
}
