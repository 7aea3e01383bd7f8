// From the command line to the exit status.
#pragma once

#include <optional>

#include "exit_status.h"

namespace CLI {
class App;
}

namespace dermis::samples {

/// Of a program that ends with any of them; the last word of its --help.
inline constexpr const char* exitStatusHelp =
    "Exit status: 0 success, 1 verification failed, 2 wrong usage, 3 bad input,\n"
    "4 no usable device, 5 any other error.";

/// Nothing where the program is to go on; otherwise help was printed, or what is wrong.
std::optional<ExitStatus> parseOptions(CLI::App& app, int argc, char** argv);

/// What `main` returns. What `run` throws, and standard output that cannot be written, is reported.
/// `run` gets the arguments in UTF-8, on Windows too.
int runProgram(const char* name, int argc, char** argv, ExitStatus (*run)(int argc, char** argv));

}  // namespace dermis::samples
