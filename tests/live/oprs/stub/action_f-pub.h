#include "stub_kernel.h"
