#include "../stand_in_houdini.hpp"
