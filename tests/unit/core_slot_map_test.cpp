// Handles: each finds its thing, and none a thing that came later.

#include "scene/slot_map.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <vector>

namespace dermis::test {
namespace {

using Things = SlotMap<int, InstanceHandle>;

TEST(SlotMap, ANullHandleFindsNothing) {
  Things things;
  EXPECT_EQ(things.find({}), nullptr);
  things.add(1);
  EXPECT_EQ(things.find({}), nullptr);
  EXPECT_FALSE(InstanceHandle());
}

TEST(SlotMap, AHandleOfARemovedThingDoesNotFindItsSuccessor) {
  Things things;
  const InstanceHandle first = things.add(1);
  things.remove(first);
  const InstanceHandle second = things.add(2);
  EXPECT_EQ(second.index, first.index) << "places are given again";
  EXPECT_EQ(things.find(first), nullptr);
  ASSERT_NE(things.find(second), nullptr);
  EXPECT_EQ(*things.find(second), 2);
}

TEST(SlotMap, KeepsToAModel) {
  std::mt19937 random(3);
  Things things;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> model;
  std::vector<InstanceHandle> gone;
  for (int step = 0; step < 20'000; ++step) {
    if (random() % 5 < 3 || model.empty()) {
      const InstanceHandle handle = things.add(step);
      ASSERT_TRUE(handle);
      ASSERT_TRUE(model.emplace(std::pair{handle.index, handle.generation}, step).second);
    } else {
      auto entry = model.begin();
      std::advance(entry, random() % std::min<std::size_t>(model.size(), 50));
      const InstanceHandle handle{entry->first.first, entry->first.second};
      ASSERT_EQ(*things.find(handle), entry->second);
      things.remove(handle);
      gone.push_back(handle);
      model.erase(entry);
    }
    ASSERT_EQ(things.size(), model.size());
    ASSERT_EQ(things.find(gone.empty() ? InstanceHandle() : gone[random() % gone.size()]), nullptr);
  }
}

}  // namespace
}  // namespace dermis::test
