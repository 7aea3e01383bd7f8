#include "kit/output_file.h"

#include <fmt/format.h>

#include <cstdint>
#include <random>

namespace dermis::samples {

std::string temporaryNameIn(const std::filesystem::path& folder) {
  std::random_device random;
  const std::uint64_t number = std::uint64_t{random()} << 32 | random();
  return (folder / fmt::format(".dermis-{:016x}.part", number)).string();
}

Result<std::unique_ptr<OutputFile>> OutputFile::create(const std::filesystem::path& path) {
  const Result<OutputTarget> target = findTarget(path);
  if (!target) return target.error();
  return createFor(*target);
}

Result<void> writeFile(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const Result<OutputTarget> target = findTarget(path);
  if (!target) return target.error();
  if (target->isThrough) return writeThrough(*target, bytes);
  const Result<std::unique_ptr<OutputFile>> file = OutputFile::createFor(*target);
  if (!file) return file.error();
  if (Result<void> written = (*file)->write(bytes); !written) return written;
  return (*file)->commit();
}

Result<void> writeFile(const std::filesystem::path& path, const std::string& text) {
  return writeFile(path, std::as_bytes(std::span(text)));
}

}  // namespace dermis::samples
