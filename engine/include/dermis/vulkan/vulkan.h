// All of dermis::vulkan.
#pragma once

#include "dermis/vulkan/acceleration_structure.h"
#include "dermis/vulkan/bindings.h"
#include "dermis/vulkan/buffer_callbacks.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/kernels.h"
#include "dermis/vulkan/scope.h"
#include "dermis/vulkan/skinning_system.h"
#include "dermis/vulkan/vertex_input.h"
