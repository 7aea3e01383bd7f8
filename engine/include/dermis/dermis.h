// All of dermis::core: what needs no Vulkan.
#pragma once

#include "dermis/accuracy.h"
#include "dermis/bounds.h"
#include "dermis/centers_of_rotation.h"
#include "dermis/dual_quat.h"
#include "dermis/glm.h"
#include "dermis/handle.h"
#include "dermis/instance.h"
#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/pack.h"
#include "dermis/plan.h"
#include "dermis/reference.h"
#include "dermis/result.h"
#include "dermis/types.h"
#include "dermis/validate.h"
#include "dermis/version.h"
