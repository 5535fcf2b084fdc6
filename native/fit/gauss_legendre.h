// Gauss and Legendre's rule of 20 nodes on (0, 1).
#pragma once

namespace gpis::gauss {

inline constexpr int kNodes = 20;
// Half of them: the others mirror these.
inline constexpr double kNode[10] = {0.0034357004074525, 0.0180140363610431, 0.0438827858743371,
                                     0.0804415140888906, 0.1268340467699246, 0.1819731596367425,
                                     0.2445664990245865, 0.3131469556422902, 0.3861070744291775,
                                     0.4617367394332513};
inline constexpr double kWeight[10] = {0.0088070035695761, 0.0203007149001935, 0.0313360241670545,
                                       0.0416383707883524, 0.0509650599086202, 0.0590972659807592,
                                       0.0658443192245883, 0.0710480546591910, 0.0745864932363019,
                                       0.0763766935653629};

inline double node(int i) {
  return i < 10 ? kNode[i] : 1 - kNode[i - 10];
}
inline double weight(int i) {
  return kWeight[i % 10];
}

}  // namespace gpis::gauss
