#include "../stand_in_maya.hpp"
