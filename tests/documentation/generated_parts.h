// What parts of the documents are made from: code of samples and tests, programs, the library.
#pragma once

#include <string>

#include "documents.h"

namespace dermis::test {

/// The lines that must stand in the document; empty if the source does not exist or is empty.
std::string generate(const HeldPart& part);

/// Without what does not matter of what a program printed: CLI11 wraps and capitalises headings in
/// other ways in other versions.
std::string withoutLayout(const std::string& help);

}  // namespace dermis::test
