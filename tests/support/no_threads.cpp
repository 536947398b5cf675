// Preloaded into a program, it leaves it no thread beyond the first SPHERECUT_THREADS that it makes.
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <dlfcn.h>
#include <pthread.h>

extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*run)(void*),
                              void* argument) noexcept {
  static std::atomic<int> made{0};
  const char* const allowed = std::getenv("SPHERECUT_THREADS");
  if (allowed != nullptr && made.fetch_add(1) >= std::atoi(allowed))
    return EAGAIN;
  static const auto real = reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"));
  return real(thread, attributes, run, argument);
}
