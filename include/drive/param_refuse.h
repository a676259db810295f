/* How the build refuses a parameter: a call that constant folding does not remove stops the compiler with its message.
 *
 * gcc 4.5, the chip's compiler, has no _Static_assert. With one function a parameter the compiler's other messages name the parameter,
 * too ("In function 'range_of_..."). The functions are empty in the end, and the linker drops them. */
#ifndef DRIVE_PARAM_REFUSE_H
#define DRIVE_PARAM_REFUSE_H

/** Head of a function that is there to be compiled. */
#define PARAM_CHECK(function) \
    void function(void); \
    void function(void)

/** A block that refuses; `function` is a name that nothing else has. */
#define PARAM_REFUSE(function, ...) \
    { \
        extern void function(void) __attribute__((error("userparams.h: " __VA_ARGS__))); \
        function(); \
    }

/** What a parameter may be, in a message: "0.01 .. 40 ohm (phase resistance)". */
#define PARAM_RANGE(unit, min, max, meaning) #min " .. " #max " " unit " (" meaning ")"

#endif
