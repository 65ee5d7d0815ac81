/* The page's clock as dcloth_timer wants it. A module cannot read one; the host lends `now_microseconds`. */
#include <stdint.h>

__attribute__((import_module("dcloth"), import_name("now_microseconds"))) double dcloth_web_now_microseconds(void);

static uint64_t Now(void* context) {
  (void)context;
  return (uint64_t)dcloth_web_now_microseconds();
}

typedef uint64_t (*Clock)(void* context);

/* For dcloth_timer.now, in microseconds. */
Clock dcloth_web_clock_address(void);
Clock dcloth_web_clock_address(void) { return Now; }
