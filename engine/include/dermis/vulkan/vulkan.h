// All headers of dermis::vulkan except vertex_input.h and acceleration_structure.h, which include
// vulkan_core.h, and vma.h, which needs vk_mem_alloc.h. An engine that uses volk includes volk.h
// before the first two, or defines VK_NO_PROTOTYPES.
#pragma once

#include "dermis/vulkan/barrier.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/buffer_callbacks.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/handles.h"
#include "dermis/vulkan/kernels.h"
#include "dermis/vulkan/scene_recorder.h"
