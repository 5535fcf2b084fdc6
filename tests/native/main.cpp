// native_tests [NAME...]: runs all tests, or those named; --list prints the names.
#include <cstring>

#include "check.h"

int main(int argc, char** argv) {
  using namespace gpis::test;
  if (argc == 2 && !std::strcmp(argv[1], "--list")) {
    for (const Case& c : cases()) std::cout << c.name << "\n";
    return 0;
  }
  int run = 0;
  for (const Case& c : cases()) {
    bool wanted = argc == 1;
    for (int i = 1; i < argc; ++i) wanted |= !std::strcmp(argv[i], c.name);
    if (!wanted) continue;
    ++run;
    context().clear();
    const int before = failures();
    c.run();
    std::cout << (failures() == before ? "ok      " : "FAILED  ") << c.name << std::endl;
  }
  std::cout << run << " tests, " << failures() << " failed checks" << std::endl;
  return failures() == 0 && run > 0 ? 0 : 1;
}
