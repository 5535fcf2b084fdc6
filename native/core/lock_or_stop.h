// A lock that a render which is cancelled meanwhile does not wait for.
#pragma once

#include <atomic>
#include <chrono>
#include <mutex>

namespace gpis {

// Owns the mutex, unless *stop became true while another thread held it.
inline std::unique_lock<std::timed_mutex> lock_or_stop(std::timed_mutex& mutex,
                                                       const std::atomic<bool>* stop) {
  std::unique_lock lock(mutex, std::defer_lock);
  while (!lock.try_lock_for(std::chrono::milliseconds(20)))
    if (stop && *stop) break;
  return lock;
}

}  // namespace gpis
