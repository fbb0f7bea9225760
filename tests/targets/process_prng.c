/*
 * bcryptprimitives.dll for versions of Wine before 9, which have none: std takes random numbers from it, and Windows has it
 * since version 7. Without it a program ends at its start, without a word.
 */

#include <windows.h>

#include <ntsecapi.h>

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T size)
{
    return RtlGenRandom(data, (ULONG)size);
}
