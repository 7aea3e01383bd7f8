// The right answer for every mesh in every pose that was asked for, kept.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>

#include "character.h"
#include "dermis/result.h"
#include "dermis/verify/reference.h"

namespace crowd {

struct ReferenceKey {
  std::uint32_t part = 0;
  PoseKey pose;

  friend auto operator<=>(const ReferenceKey&, const ReferenceKey&) = default;
};

class References {
 public:
  explicit References(const Character& character) : character_(&character) {}

  /// Finds what is missing of them, on all cores.
  dermis::Result<void> prepare(std::span<const ReferenceKey> keys);
  /// Of a key that has been prepared.
  const dermis::reference::SkinnedMesh& of(const ReferenceKey& key) const;

 private:
  dermis::Result<dermis::reference::SkinnedMesh> skin(const ReferenceKey& key) const;

  const Character* character_;
  std::map<ReferenceKey, std::unique_ptr<dermis::reference::SkinnedMesh>> kept_;
};

}  // namespace crowd
