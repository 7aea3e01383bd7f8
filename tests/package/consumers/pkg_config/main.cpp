// A program with one library of Dermis, all of which is linked in.
#include "dermis/result.h"

int main() {
  return dermis::libraryFitsHeaders() ? 0 : 1;
}
