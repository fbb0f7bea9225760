/*
 * Stands in for the Houdini Development Kit, so that the example in examples/hosts/houdini is compiled by the tests: declarations of the few
 * members that it uses, written from the public documentation. Nothing here does anything; it is not linked.
 */

#ifndef STAND_IN_HOUDINI_HPP
#define STAND_IN_HOUDINI_HPP

#include <cstdint>

using exint = std::int64_t;
using fpreal = double;
using GA_Offset = exint;
using GA_Index = exint;
using GA_Size = exint;

/* Three floats. */
class UT_Vector3 {
public:
    UT_Vector3() = default;
    UT_Vector3(float x, float y, float z);
    bool operator==(const UT_Vector3 &other) const;

private:
    float vec_[3];
};

enum UT_ErrorSeverity { UT_ERROR_NONE, UT_ERROR_MESSAGE, UT_ERROR_PROMPT, UT_ERROR_WARNING, UT_ERROR_ABORT };
using OP_ERROR = UT_ErrorSeverity;

class UT_AutoInterrupt {
public:
    explicit UT_AutoInterrupt(const char *message);
    ~UT_AutoInterrupt();
    bool wasInterrupted(int percent = -1);
};

template <class T> class UT_BlockedRange {
public:
    T begin() const;
    T end() const;
};

template <class Integer, class Body> void UTparallelForEachNumber(Integer count, const Body &body)
{
    if (count > 0) {
        body(UT_BlockedRange<Integer>());
    }
}

enum GA_AttributeOwner { GA_ATTRIB_VERTEX, GA_ATTRIB_POINT, GA_ATTRIB_PRIMITIVE, GA_ATTRIB_DETAIL };

class GA_Attribute;

class GA_PrimitiveTypeId {
public:
    bool operator==(int type) const;
};
constexpr int GEO_PRIMPOLY = 1;

class GA_Primitive {
public:
    const GA_PrimitiveTypeId &getTypeId() const;
    GA_Size getVertexCount() const;
    GA_Offset getVertexOffset(GA_Size corner) const;
};

template <class T> class GA_Handle {
public:
    explicit GA_Handle(const GA_Attribute *attribute);
    bool isValid() const;
    T get(GA_Offset offset) const;
    void set(GA_Offset offset, const T &value) const;
};
using GA_ROHandleV3 = GA_Handle<UT_Vector3>;
using GA_RWHandleV3 = GA_Handle<UT_Vector3>;
using GA_ROHandleF = GA_Handle<float>;

class GU_Detail {
public:
    UT_Vector3 getPos3(GA_Offset point) const;
    GA_Index pointIndex(GA_Offset point) const;
    GA_Offset vertexPoint(GA_Offset vertex) const;
    const GA_Attribute *findFloatTuple(GA_AttributeOwner owner, const char *name, int least, int most) const;
    GA_Attribute *addFloatTuple(GA_AttributeOwner owner, const char *name, int components);
};

/* The loops are macros in the kit, too. */
bool stand_in_next(const GU_Detail *geometry, GA_Offset &point);
bool stand_in_next(const GU_Detail *geometry, const GA_Primitive *&primitive);
#define GA_FOR_ALL_PTOFF(geometry, point) for (point = 0; stand_in_next(geometry, point);)
#define GA_FOR_ALL_PRIMITIVES(geometry, primitive) for (primitive = nullptr; stand_in_next(geometry, primitive);)

class PRM_Name {
public:
    PRM_Name(const char *token = nullptr, const char *label = nullptr);
};
class PRM_Default {
public:
    explicit PRM_Default(fpreal value = 0);
};
enum PRM_ChoiceListType { PRM_CHOICELIST_SINGLE };
class PRM_ChoiceList {
public:
    PRM_ChoiceList(PRM_ChoiceListType type, PRM_Name *names);
};
enum PRM_Type { PRM_INT, PRM_ORD };
class PRM_Template {
public:
    PRM_Template();
    PRM_Template(PRM_Type type, int components, PRM_Name *name, PRM_Default *value = nullptr,
                 PRM_ChoiceList *choices = nullptr);
};

class OP_Node;
class OP_Network;
class OP_Operator;
using OP_Constructor = OP_Node *(*)(OP_Network *network, const char *name, OP_Operator *type);

class OP_Operator {
public:
    OP_Operator(const char *name, const char *label, OP_Constructor construct, PRM_Template *templates,
                unsigned least_inputs, unsigned most_inputs);
};

class OP_OperatorTable {
public:
    bool addOperator(OP_Operator *type);
};

class OP_Context {
public:
    fpreal getTime() const;
};

class OP_Node {
public:
    virtual ~OP_Node();
    virtual const char *inputLabel(unsigned index) const;
    exint evalInt(const char *name, int component, fpreal time) const;
    OP_ERROR error();
};

class OP_AutoLockInputs {
public:
    explicit OP_AutoLockInputs(OP_Node *node);
    ~OP_AutoLockInputs();
    OP_ERROR lock(OP_Context &context);
};

enum SOP_ErrorCodes { SOP_MESSAGE };

class SOP_Node : public OP_Node {
protected:
    SOP_Node(OP_Network *network, const char *name, OP_Operator *type);
    virtual OP_ERROR cookMySop(OP_Context &context) = 0;
    OP_ERROR duplicateSource(unsigned input, OP_Context &context);
    const GU_Detail *inputGeo(unsigned input, OP_Context &context) const;
    void addError(SOP_ErrorCodes code, const char *text);

    GU_Detail *gdp;
};

/* In the kit, UT_DSOVersion.h declares the function that Houdini calls. */
void newSopOperator(OP_OperatorTable *table);

#endif
