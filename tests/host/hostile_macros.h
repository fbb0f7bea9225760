/*
 * Names that windows.h, Xlib.h, Qt, macOS and old C libraries define as macros. Included after the standard library and
 * before vrtm.hpp, as a host's source may do it.
 */

#ifndef HOSTILE_MACROS_H
#define HOSTILE_MACROS_H

#define min(a, b) (((a) < (b)) ? (a) : (b))
#define max(a, b) (((a) > (b)) ? (a) : (b))
#define ERROR 0
#ifndef NO_ERROR
#define NO_ERROR 0L
#endif
#define IN
#define OUT
#define OPTIONAL
#define OPAQUE 2
#ifndef DELETE
#define DELETE 0x00010000L
#endif
#define near
#define far
#define small char
#define interface struct
#define Status int
#define Bool int
#define True 1
#define False 0
#define None 0L
#define Success 0
#define Always 2
#define emit
#define slots
#define signals public
#define foreach for
#define check(assertion) hostile
#define verify(assertion) hostile
#define require(assertion, label) hostile
#define major(device) hostile
#define minor(device) hostile

#endif
