// A cache of the reference result for every mesh and pose that was requested.
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

  /// Computes those that are missing, on all cores.
  dermis::Result<void> prepare(std::span<const ReferenceKey> keys);
  /// The result for a key that has been prepared.
  const dermis::reference::SkinnedMesh& of(const ReferenceKey& key) const;

 private:
  dermis::Result<dermis::reference::SkinnedMesh> skin(const ReferenceKey& key) const;

  const Character* character_;
  std::map<ReferenceKey, std::unique_ptr<dermis::reference::SkinnedMesh>> kept_;
};

}  // namespace crowd
