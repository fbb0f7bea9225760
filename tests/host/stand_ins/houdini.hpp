/*
 * Stands in for the Houdini Development Kit, so that the tests compile and run the example in examples/hosts/houdini:
 * the few members that it uses, written from the public documentation. What is called stand_in is not Houdini's: with
 * it tests/host/stand_ins/houdini_example.cpp drives the node.
 */

#ifndef STAND_IN_HOUDINI_HPP
#define STAND_IN_HOUDINI_HPP

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

using exint = std::int64_t;
using fpreal = double;
using GA_Offset = exint;
using GA_Index = exint;
using GA_Size = exint;
using GA_DataId = exint;
#define GA_INVALID_DATAID GA_DataId(-1)

/* Three floats. */
class UT_Vector3 {
public:
    UT_Vector3() = default;
    UT_Vector3(float x, float y, float z) : vec_{x, y, z} {}
    bool operator==(const UT_Vector3 &other) const
    {
        return vec_[0] == other.vec_[0] && vec_[1] == other.vec_[1] && vec_[2] == other.vec_[2];
    }
    float operator()(unsigned component) const { return vec_[component]; }
    float &operator()(unsigned component) { return vec_[component]; }

private:
    float vec_[3];
};

enum UT_ErrorSeverity { UT_ERROR_NONE, UT_ERROR_MESSAGE, UT_ERROR_PROMPT, UT_ERROR_WARNING, UT_ERROR_ABORT };
using OP_ERROR = UT_ErrorSeverity;

class UT_AutoInterrupt {
public:
    explicit UT_AutoInterrupt(const char *) {}
    bool wasInterrupted(int = -1) { return stand_in_pressed; }
    static inline bool stand_in_pressed = false;
};

template <class T> class UT_BlockedRange {
public:
    T begin() const { return 0; }
    T end() const { return stand_in_end; }
    T stand_in_end;
};

template <class Integer, class Body> void UTparallelForEachNumber(Integer count, const Body &body)
{
    body(UT_BlockedRange<Integer>{count});
}

enum GA_AttributeOwner { GA_ATTRIB_VERTEX, GA_ATTRIB_POINT, GA_ATTRIB_PRIMITIVE, GA_ATTRIB_DETAIL };

class GA_Attribute {
public:
    GA_DataId getDataId() const { return stand_in_id; }
    GA_DataId stand_in_id = GA_INVALID_DATAID;
    std::vector<UT_Vector3> stand_in;
};

class GA_PrimitiveTypeId {
public:
    bool operator==(int) const { return true; }
};
constexpr int GEO_PRIMPOLY = 1;

class GA_Primitive {
public:
    const GA_PrimitiveTypeId &getTypeId() const { return type_; }
    GA_Size getVertexCount() const { return GA_Size(stand_in_vertices.size()); }
    GA_Offset getVertexOffset(GA_Size corner) const { return stand_in_vertices[std::size_t(corner)]; }
    std::vector<GA_Offset> stand_in_vertices;

private:
    GA_PrimitiveTypeId type_;
};

inline UT_Vector3 &stand_in_value(UT_Vector3 &vector, const UT_Vector3 *) { return vector; }
inline float &stand_in_value(UT_Vector3 &vector, const float *) { return vector(0); }

template <class T> class GA_Handle {
public:
    explicit GA_Handle(const GA_Attribute *attribute) : attribute_(const_cast<GA_Attribute *>(attribute)) {}
    bool isValid() const { return attribute_ != nullptr; }
    T get(GA_Offset offset) const { return value(offset); }
    void set(GA_Offset offset, const T &value_to_set) const { value(offset) = value_to_set; }

private:
    T &value(GA_Offset at) const
    {
        return stand_in_value(attribute_->stand_in[std::size_t(at)], static_cast<const T *>(nullptr));
    }
    GA_Attribute *attribute_;
};
using GA_ROHandleV3 = GA_Handle<UT_Vector3>;
using GA_RWHandleV3 = GA_Handle<UT_Vector3>;
using GA_ROHandleF = GA_Handle<float>;

/* The number of a detail's topology, or of its list of primitives. */
class StandInNumbered {
public:
    GA_DataId getDataId() const { return stand_in_id; }
    GA_DataId stand_in_id = GA_INVALID_DATAID;
};

/* How often primitives were read is counted. */
class GU_Detail {
public:
    UT_Vector3 getPos3(GA_Offset point) const { return stand_in_positions.stand_in[std::size_t(point)]; }
    GA_Index pointIndex(GA_Offset point) const { return point; }
    GA_Offset vertexPoint(GA_Offset vertex) const { return stand_in_points[std::size_t(vertex)]; }
    const GA_Attribute *getP() const { return &stand_in_positions; }
    const StandInNumbered &getTopology() const { return stand_in_topology; }
    const StandInNumbered &getPrimitiveList() const { return stand_in_topology; }
    const GA_Attribute *findFloatTuple(GA_AttributeOwner, const char *name, int, int) const
    {
        const auto found = stand_in_attributes.find(name);
        return found == stand_in_attributes.end() ? nullptr : &found->second;
    }
    GA_Attribute *addFloatTuple(GA_AttributeOwner, const char *name, int)
    {
        GA_Attribute &attribute = stand_in_attributes[name];
        attribute.stand_in.resize(stand_in_points.size());
        return &attribute;
    }

    GA_Attribute stand_in_positions;
    StandInNumbered stand_in_topology;
    std::vector<GA_Primitive> stand_in_primitives;
    std::vector<GA_Offset> stand_in_points; /* of each vertex */
    std::map<std::string, GA_Attribute> stand_in_attributes;
    mutable int stand_in_reads = 0;
};

/* The loops are macros in the kit, too. */
inline bool stand_in_next(const GU_Detail *geometry, GA_Offset point)
{
    return point < GA_Offset(geometry->stand_in_positions.stand_in.size());
}
inline const GA_Primitive *stand_in_first(const GU_Detail *geometry)
{
    geometry->stand_in_reads += 1;
    return geometry->stand_in_primitives.data();
}
inline const GA_Primitive *stand_in_end(const GU_Detail *geometry)
{
    return geometry->stand_in_primitives.data() + geometry->stand_in_primitives.size();
}
#define GA_FOR_ALL_PTOFF(geometry, point) for (point = 0; stand_in_next(geometry, point); ++point)
#define GA_FOR_ALL_PRIMITIVES(geometry, primitive) \
    for (primitive = stand_in_first(geometry); primitive != stand_in_end(geometry); ++primitive)

class PRM_Name {
public:
    PRM_Name(const char * = nullptr, const char * = nullptr) {}
};
class PRM_Default {
public:
    explicit PRM_Default(fpreal = 0) {}
};
enum PRM_ChoiceListType { PRM_CHOICELIST_SINGLE };
class PRM_ChoiceList {
public:
    PRM_ChoiceList(PRM_ChoiceListType, PRM_Name *) {}
};
enum PRM_Type { PRM_INT, PRM_ORD };
class PRM_Template {
public:
    PRM_Template() {}
    PRM_Template(PRM_Type, int, PRM_Name *, PRM_Default * = nullptr, PRM_ChoiceList * = nullptr) {}
};

class OP_Node;
class OP_Network;
class OP_Operator;
using OP_Constructor = OP_Node *(*)(OP_Network *network, const char *name, OP_Operator *type);

class OP_Operator {
public:
    OP_Operator(const char *, const char *, OP_Constructor, PRM_Template *, unsigned, unsigned) {}
};

class OP_OperatorTable {
public:
    bool addOperator(OP_Operator *type)
    {
        delete type;
        stand_in_count += 1;
        return true;
    }
    int stand_in_count = 0;
};

class OP_Context {
public:
    fpreal getTime() const { return 0; }
};

class OP_Node {
public:
    virtual ~OP_Node() = default;
    virtual const char *inputLabel(unsigned) const { return ""; }
    exint evalInt(const char *name, int, fpreal) const { return stand_in_values.at(name); }
    OP_ERROR error() { return stand_in_error.empty() ? UT_ERROR_NONE : UT_ERROR_ABORT; }

    std::map<std::string, exint> stand_in_values;
    std::string stand_in_error, stand_in_warning;
};

class OP_AutoLockInputs {
public:
    explicit OP_AutoLockInputs(OP_Node *) {}
    OP_ERROR lock(OP_Context &) { return UT_ERROR_NONE; }
};

enum SOP_ErrorCodes { SOP_MESSAGE };

class SOP_Node : public OP_Node {
public:
    GU_Detail *stand_in_inputs[2] = {}, stand_in_output;

protected:
    SOP_Node(OP_Network *, const char *, OP_Operator *) : gdp(&stand_in_output) {}
    virtual OP_ERROR cookMySop(OP_Context &context) = 0;
    OP_ERROR duplicateSource(unsigned input, OP_Context &)
    {
        *gdp = *stand_in_inputs[input];
        stand_in_error.clear();
        stand_in_warning.clear();
        return UT_ERROR_NONE;
    }
    const GU_Detail *inputGeo(unsigned input, OP_Context &) const { return stand_in_inputs[input]; }
    void addError(SOP_ErrorCodes, const char *text) { stand_in_error = text; }
    void addWarning(SOP_ErrorCodes, const char *text) { stand_in_warning = text; }

    GU_Detail *gdp;
};

/* In the kit, UT_DSOVersion.h declares the function that Houdini calls. */
void newSopOperator(OP_OperatorTable *table);

#endif
