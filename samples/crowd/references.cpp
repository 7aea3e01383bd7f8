#include "references.h"

#include <utility>
#include <vector>

#include "crowd.h"
#include "in_parallel.h"

using namespace dermis;

namespace crowd {

Result<reference::SkinnedMesh> References::skin(const ReferenceKey& key) const {
  const Part& part = character_->parts()[key.part];
  return reference::skin(part.primitive.mesh(), character_->pose(key.pose, part.skin),
                         Crowd::method);
}

Result<void> References::prepare(std::span<const ReferenceKey> keys) {
  std::vector<std::pair<ReferenceKey, reference::SkinnedMesh*>> missing;
  for (const ReferenceKey& key : keys) {
    std::unique_ptr<reference::SkinnedMesh>& kept = kept_[key];
    if (kept != nullptr) continue;
    kept = std::make_unique<reference::SkinnedMesh>();
    missing.emplace_back(key, kept.get());
  }
  std::vector<Result<void>> done(missing.size());
  inParallel(missing.size(), [&](std::size_t index) {
    const auto& [key, place] = missing[index];
    Result<reference::SkinnedMesh> skinned = skin(key);
    if (skinned) {
      *place = std::move(*skinned);
    } else {
      done[index] = skinned.error();
    }
  });
  for (const Result<void>& each : done) {
    if (!each) return each;
  }
  return {};
}

const reference::SkinnedMesh& References::of(const ReferenceKey& key) const {
  return *kept_.at(key);
}

}  // namespace crowd
