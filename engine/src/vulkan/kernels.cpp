#include "dermis/vulkan/kernels.h"

#include "abi.h"
#include "dermis_kernels.h"

namespace dermis::vulkan {

static_assert(abi::CONSTANT_COUNT == 5 && abi::CONSTANT_WORKGROUP_SIZE == 0 &&
              abi::CONSTANT_METHOD == 1 && abi::CONSTANT_NORMALS == 2 &&
              abi::CONSTANT_INFLUENCES == 3 && abi::CONSTANT_INSTANCES == 4);
static_assert(abi::METHOD_LINEAR == static_cast<std::uint32_t>(Method::linear));
static_assert(abi::METHOD_DUAL_QUATERNION == static_cast<std::uint32_t>(Method::dualQuaternion));
static_assert(sizeof(DispatchConstants) == abi::PUSH_WORDS * 4);
static_assert(sizeof(PaletteStatus) == 16 && abi::STATUS_TWO_PHASE == 0 &&
              abi::STATUS_NON_RIGID == 1 && abi::STATUS_UNDECLARED_SCALE == 2 &&
              abi::STATUS_NON_FINITE == 3);

std::span<const std::uint32_t> kernelSpirv(Kernel kernel) {
  return kernel == Kernel::palette ? kernels::palette_spirv : kernels::skin_spirv;
}

std::array<std::uint32_t, 5> specializationConstants(const Variant& variant) {
  return {variant.workgroupSize, static_cast<std::uint32_t>(variant.method),
          variant.normals ? 1u : 0u, variant.influences, variant.instancesPerInvocation};
}

}  // namespace dermis::vulkan
