// Which driver a device has, for those who compare measurements.
#pragma once

#include <string>

#include "device.h"

namespace dermis::samples {

/// "llvmpipe Mesa 22.3.6 (LLVM 15.0.6)" or, where the driver does not say so much, its number.
std::string driverVersion(const Device& device);

}  // namespace dermis::samples
