#include "dermis/vulkan/kernels.h"

#include "abi.h"
#include "dermis_kernels.h"

namespace dermis::vulkan {

static_assert(abi::CONSTANT_COUNT <= SpecializationConstants().values.size());
static_assert(abi::METHOD_LINEAR == static_cast<std::uint32_t>(Method::linear));
static_assert(abi::METHOD_DUAL_QUATERNION == static_cast<std::uint32_t>(Method::dualQuaternion));
static_assert(sizeof(DispatchConstants) == abi::PUSH_WORDS * 4);
static_assert(sizeof(PaletteStatus) == 16 && abi::STATUS_TWO_PHASE == 0 &&
              abi::STATUS_NON_RIGID == 1 && abi::STATUS_UNDECLARED_SCALE == 2 &&
              abi::STATUS_NON_FINITE == 3);

std::span<const std::uint32_t> kernelSpirv(Kernel kernel) {
  return kernel == Kernel::palette ? kernels::palette_spirv : kernels::skin_spirv;
}

SpecializationConstants specializationConstants(const Variant& variant) {
  SpecializationConstants constants;
  constants.count = abi::CONSTANT_COUNT;
  constants.values[abi::CONSTANT_WORKGROUP_SIZE] = variant.workgroupSize;
  constants.values[abi::CONSTANT_METHOD] = static_cast<std::uint32_t>(variant.method);
  constants.values[abi::CONSTANT_NORMALS] = variant.normals ? 1u : 0u;
  constants.values[abi::CONSTANT_INFLUENCES] = variant.influences;
  constants.values[abi::CONSTANT_INSTANCES] = variant.instancesPerInvocation;
  return constants;
}

}  // namespace dermis::vulkan
