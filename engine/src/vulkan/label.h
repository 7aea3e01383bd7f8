// Names for stretches of a command buffer, in tools that capture frames.
#pragma once

#include "vulkan/dispatch_table.h"

namespace dermis::vulkan {

/// A stretch for as long as it lives; nothing where VK_EXT_debug_utils was not enabled.
class Label {
 public:
  Label(const DispatchTable& table, VkCommandBuffer commandBuffer, const char* name)
      : table_(table), commandBuffer_(commandBuffer) {
    if (table_.cmdBeginDebugUtilsLabel == nullptr) return;
    VkDebugUtilsLabelEXT label{};
    label.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_LABEL_EXT;
    label.pLabelName = name;
    table_.cmdBeginDebugUtilsLabel(commandBuffer_, &label);
  }
  ~Label() {
    if (table_.cmdEndDebugUtilsLabel != nullptr) table_.cmdEndDebugUtilsLabel(commandBuffer_);
  }
  Label(const Label&) = delete;
  Label& operator=(const Label&) = delete;

 private:
  const DispatchTable& table_;
  VkCommandBuffer commandBuffer_;
};

}  // namespace dermis::vulkan
