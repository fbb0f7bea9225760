/*
 * A plug-in for QEMU's emulators of user programs that counts instructions by kind, as the disassembly has them: arithmetic
 * of floating-point numbers (+ - * /, square roots, minima and maxima; 32 or 64 bits; on vectors or on single numbers), and
 * all together. For ARM64 and x86-64. Its argument is the file that it writes the counts to: to=PATH.
 */

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What this needs of QEMU's interface for plug-ins, whose header few systems have as a package. */
typedef uint64_t plugin_id;
struct block;
struct instruction;
enum { ADD = 0 };
void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id id, void (*translated)(plugin_id, struct block *));
size_t qemu_plugin_tb_n_insns(const struct block *block);
struct instruction *qemu_plugin_tb_get_insn(const struct block *block, size_t index);
char *qemu_plugin_insn_disas(const struct instruction *instruction);
void qemu_plugin_register_vcpu_insn_exec_inline(struct instruction *instruction, int operation, void *to, uint64_t value);
void qemu_plugin_register_atexit_cb(plugin_id id, void (*ended)(plugin_id, void *), void *data);

int qemu_plugin_version = 1;
int qemu_plugin_install(plugin_id id, const void *info, int count, char **arguments);

/* Vectors of eight, of four, of two f32; single f32; vectors and single f64. */
enum { EIGHT, FOUR, TWO, ONE, VECTOR_F64, ONE_F64, ALL, KINDS };
static const char *const names[KINDS] = {"f32x8", "f32x4", "f32x2", "f32", "f64x2", "f64", "all"};
static uint64_t counts[KINDS];
static char file[4096];

static int starts(const char *text, const char *const *words)
{
    for (; *words != NULL; ++words) {
        if (strncmp(text, *words, strlen(*words)) == 0) {
            return (int)strlen(*words);
        }
    }
    return 0;
}

static int kind(const char *text)
{
    static const char *const arm[] = {"fadd ", "fsub ", "fmul ", "fdiv ", "fsqrt ", "fmax ", "fmin ", "fmaxnm ", "fminnm ",
                                      "fneg ", "fabs ", "fmla ", "fmls ", "fmadd ", "fmsub ", "fnmul ", NULL};
    static const char *const intel[] = {"add", "sub", "mul", "div", "sqrt", "max", "min", NULL};
    if (starts(text, arm) != 0) {
        const char *operands = strchr(text, ' ') + 1;
        if (strstr(operands, ".2d") != NULL) {
            return VECTOR_F64;
        }
        if (strstr(operands, ".4s") != NULL) {
            return FOUR;
        }
        if (strstr(operands, ".2s") != NULL) {
            return TWO;
        }
        return *operands == 'd' ? ONE_F64 : ONE;
    }
    const char *name = *text == 'v' ? text + 1 : text;
    const int length = starts(name, intel);
    if (length != 0) {
        const char *type = name + length;
        if (strncmp(type, "ps ", 3) == 0) {
            return strstr(type, "ymm") != NULL ? EIGHT : FOUR;
        }
        if (strncmp(type, "ss ", 3) == 0) {
            return ONE;
        }
        if (strncmp(type, "pd ", 3) == 0) {
            return VECTOR_F64;
        }
        if (strncmp(type, "sd ", 3) == 0) {
            return ONE_F64;
        }
    }
    return ALL;
}

static void translated(plugin_id id, struct block *block)
{
    (void)id;
    for (size_t k = 0; k < qemu_plugin_tb_n_insns(block); ++k) {
        struct instruction *instruction = qemu_plugin_tb_get_insn(block, k);
        char *text = qemu_plugin_insn_disas(instruction);
        const int of = text != NULL ? kind(text) : ALL;
        if (of != ALL) {
            qemu_plugin_register_vcpu_insn_exec_inline(instruction, ADD, &counts[of], 1);
        }
        qemu_plugin_register_vcpu_insn_exec_inline(instruction, ADD, &counts[ALL], 1);
        free(text);
    }
}

static void ended(plugin_id id, void *data)
{
    FILE *out = fopen(file, "w");
    (void)id;
    (void)data;
    for (int k = 0; out != NULL && k < KINDS; ++k) {
        fprintf(out, "%s %llu\n", names[k], (unsigned long long)counts[k]);
    }
    if (out != NULL) {
        fclose(out);
    }
}

int qemu_plugin_install(plugin_id id, const void *info, int count, char **arguments)
{
    (void)info;
    if (count < 1 || strncmp(arguments[0], "to=", 3) != 0) {
        return 1;
    }
    snprintf(file, sizeof file, "%s", arguments[0] + 3);
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
