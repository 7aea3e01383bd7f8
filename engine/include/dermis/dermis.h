// All headers of dermis::core except glm.h, which needs GLM.
#pragma once

#include "dermis/bounds.h"
#include "dermis/centers_of_rotation.h"
#include "dermis/handle.h"
#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/method.h"
#include "dermis/normals.h"
#include "dermis/pack.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/scene_commands.h"
#include "dermis/types.h"
#include "dermis/validate.h"
#include "dermis/version.h"
