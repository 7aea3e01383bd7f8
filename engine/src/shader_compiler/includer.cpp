#include "shader_compiler/includer.h"

#include <algorithm>
#include <filesystem>
#include <utility>

namespace dermis {
namespace {

// Files that include each other twice grow like powers of two without any cycle. Real kernels stay
// far below these limits.
constexpr std::size_t maximumDepth = 64;
constexpr std::size_t maximumIncludedBytes = std::size_t{64} << 20;

}  // namespace

Includer::Includer(IncludeResolver& resolver, std::string mainFile)
    : resolver_(resolver),
      mainFile_(std::filesystem::path(std::move(mainFile)).lexically_normal().string()) {}

Includer::IncludeResult* Includer::includeLocal(const char* headerName, const char* includerName,
                                                std::size_t) {
  return include(headerName, includerName, IncludeForm::quoted);
}

Includer::IncludeResult* Includer::includeSystem(const char* headerName, const char* includerName,
                                                 std::size_t) {
  // glslang asks here again for a quoted name that includeLocal refused, and reports this answer.
  if (!refusal_.empty()) return refuse(std::exchange(refusal_, {}));
  return include(headerName, includerName, IncludeForm::angled);
}

void Includer::releaseInclude(IncludeResult* result) {
  if (!open_.empty() && open_.back() == result) open_.pop_back();
}

Includer::IncludeResult* Includer::include(const char* headerName, const char* includerName,
                                           IncludeForm form) {
  const IncludeFile* file = resolver_.resolve(headerName, includerName, form);
  std::string reason = file == nullptr ? "no such file" : objectionTo(*file);
  if (file == nullptr || !reason.empty()) {
    if (form == IncludeForm::quoted) refusal_ = reason;
    return refuse(std::move(reason));
  }
  includedBytes_ += file->text.size();
  used_.insert(file->path);
  results_.emplace_back(file->path, file->text.data(), file->text.size(), nullptr);
  open_.push_back(&results_.back());
  return &results_.back();
}

// Why a file that was found may not be included; empty if it may.
std::string Includer::objectionTo(const IncludeFile& file) const {
  if (isOpen(file.path)) return "a file includes itself: " + describeCycle(file.path);
  if (open_.size() >= maximumDepth) return "includes are nested too deeply";
  if (file.text.size() > maximumIncludedBytes - includedBytes_) {
    return "more than 64 MiB are included";
  }
  return {};
}

// What glslang takes for a failure: an empty name, and the reason in place of the text.
Includer::IncludeResult* Includer::refuse(std::string reason) {
  reasons_.push_back(std::move(reason));
  results_.emplace_back(std::string(), reasons_.back().data(), reasons_.back().size(), nullptr);
  return &results_.back();
}

bool Includer::isOpen(const std::string& path) const {
  return path == mainFile_ ||
         std::any_of(open_.begin(), open_.end(),
                     [&](const IncludeResult* result) { return result->headerName == path; });
}

std::string Includer::describeCycle(const std::string& path) const {
  std::string description = path == mainFile_ ? path : std::string();
  for (const IncludeResult* result : open_) {
    if (description.empty() && result->headerName != path) continue;
    description += (description.empty() ? "" : " > ") + result->headerName;
  }
  return description + " > " + path;
}

}  // namespace dermis
