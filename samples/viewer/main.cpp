// dermis_viewer: shows a skinned model in a window, by every method, with what it costs.

#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "options.h"
#include "presenter.h"
#include "viewer.h"

namespace {

using namespace dermis;
using viewer::ExitStatus;
using viewer::reportError;

/// What the validation layer said is a failure.
ExitStatus reportValidation(samples::Device& device, ExitStatus status) {
  for (const std::string& message : device.takeValidationMessages())
    status = reportError(ExitStatus::stopped, message);
  return status;
}

ExitStatus run(int argc, char** argv) {
  viewer::Options options;
  if (const auto ended = viewer::readOptions(argc, argv, options)) return *ended;
  const Result<std::unique_ptr<viewer::Presenter>> presenter = viewer::Presenter::create(options);
  if (!presenter) {
    const bool isMissing = presenter.error().code == ErrorCode::missingFeature ||
                           presenter.error().code == ErrorCode::missingEntryPoint;
    return reportError(isMissing ? ExitStatus::noDevice : ExitStatus::stopped,
                       presenter.error().message);
  }
  ExitStatus status = ExitStatus::done;
  {
    viewer::Viewer program(options, **presenter);
    if (Result<void> done = program.run(); !done)
      status = reportError(ExitStatus::stopped, done.error().message);
  }
  return reportValidation(*(*presenter)->device().device, status);
}

}  // namespace

int main(int argc, char** argv) {
  ExitStatus status = ExitStatus::stopped;
  try {
    status = run(argc, argv);
  } catch (const std::bad_alloc&) {
    status = reportError(ExitStatus::stopped, "out of memory");
  } catch (const std::exception& error) {
    status = reportError(ExitStatus::stopped, error.what());
  }
  return static_cast<int>(status);
}
