// Compiled modules on disk, one file per entry.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "dermis/result.h"

namespace dermis {

using CacheKey = std::array<std::uint64_t, 2>;

struct CacheLookup {
  std::vector<std::uint32_t> words;  ///< The module; empty if there is none to use.
  std::string problem;               ///< What was wrong with the entry; empty if nothing was.
};

class Cache {
 public:
  explicit Cache(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// The module stored under `key`. An entry that is damaged, has another key, or has another
  /// version of the cache's format is deleted, and `problem` says so.
  CacheLookup load(const CacheKey& key) const;

  /// Creates the folder if it does not exist. Fails with `ioError`.
  Result<void> store(const CacheKey& key, std::span<const std::uint32_t> words) const;

 private:
  std::filesystem::path pathOf(const CacheKey& key) const;

  std::filesystem::path folder_;
};

}  // namespace dermis
