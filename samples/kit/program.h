// From the command line to the exit status.
#pragma once

#include <optional>

#include "kit/exit_status.h"

namespace CLI {
class App;
}

namespace dermis::samples {

/// The end of the --help of a program that uses all of them.
inline constexpr const char* exitStatusHelp =
    "Exit status: 0 success, 1 verification failed, 2 wrong usage, 3 bad input,\n"
    "4 no usable device, 5 any other error.";

/// Empty if the program should continue. Otherwise help or an error was printed.
std::optional<ExitStatus> parseOptions(CLI::App& app, int argc, char** argv);

/// Returns the value for `main` to return. Reports exceptions of `run`, and a standard output that
/// cannot be written. `run` gets the arguments in UTF-8, on Windows, too.
int runProgram(const char* name, int argc, char** argv, ExitStatus (*run)(int argc, char** argv));

}  // namespace dermis::samples
