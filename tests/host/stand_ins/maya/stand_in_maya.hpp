/*
 * Stands in for the Maya devkit, so that the example in examples/hosts/maya is compiled by the tests: declarations of the few
 * members that it uses, written from the public documentation. Nothing here does anything; it is not linked.
 */

#ifndef STAND_IN_MAYA_HPP
#define STAND_IN_MAYA_HPP

#include <initializer_list>

class MString {
public:
    MString();
    MString(const char *text);
    MString(const MString &other);
    ~MString();
    const char *asChar() const;
    unsigned int length() const;
    MString operator+(const MString &other) const;
    MString operator+(const char *other) const;
};

class MStatus {
public:
    enum MStatusCode { kSuccess = 0, kFailure, kInsufficientMemory, kInvalidParameter, kLicenseFailure, kUnknownParameter };
    MStatus();
    MStatus(MStatusCode code);
    operator bool() const;
};
using MS = MStatus;

class MObject {
public:
    MObject();
    MObject(const MObject &other);
    ~MObject();
    MObject &operator=(const MObject &other);
    bool isNull() const;
    static MObject kNullObj;
};

class MTypeId {
public:
    explicit MTypeId(unsigned int id);
};

class MIntArray {
public:
    MIntArray();
    ~MIntArray();
    unsigned int length() const;
    MStatus get(int array[]) const;
    int &operator[](unsigned int index);
    int operator[](unsigned int index) const;
};

class MFloatArray {
public:
    MFloatArray();
    MFloatArray(const float source[], unsigned int count);
    ~MFloatArray();
    unsigned int length() const;
    MStatus get(float array[]) const;
};

class MPointArray {
public:
    MPointArray();
    ~MPointArray();
    unsigned int length() const;
    MStatus get(double array[][4]) const;
};

class MSpace {
public:
    enum Space { kInvalid = 0, kTransform, kPreTransform, kPostTransform, kWorld, kObject = kPreTransform };
};

class MFnData {
public:
    enum Type { kInvalid = 0, kNumeric, kPlugin, kPluginGeometry, kString, kMesh };
};

class MFnNumericData {
public:
    enum Type { kInvalid = 0, kBoolean, kByte, kChar, kShort, kInt };
};

class MFnAttribute {
public:
    MStatus setStorable(bool state);
    MStatus setWritable(bool state);
    MStatus setUsedAsFilename(bool state);
};

class MFnTypedAttribute : public MFnAttribute {
public:
    MObject create(const MString &name, const MString &brief, MFnData::Type type,
                   const MObject &by_default = MObject::kNullObj, MStatus *status = nullptr);
};

class MFnNumericAttribute : public MFnAttribute {
public:
    MObject create(const MString &name, const MString &brief, MFnNumericData::Type type, double by_default = 0,
                   MStatus *status = nullptr);
    MStatus setMin(double value);
    MStatus setMax(double value);
};

class MFnEnumAttribute : public MFnAttribute {
public:
    MObject create(const MString &name, const MString &brief, short by_default = 0, MStatus *status = nullptr);
    MStatus addField(const MString &name, short value);
};

class MFnMeshData {
public:
    MObject create(MStatus *status = nullptr);
};

class MFnMesh {
public:
    MFnMesh();
    explicit MFnMesh(const MObject &object, MStatus *status = nullptr);
    ~MFnMesh();
    MObject copy(const MObject &source, MObject parent = MObject::kNullObj, MStatus *status = nullptr);
    MStatus getPoints(MPointArray &points, MSpace::Space space = MSpace::kObject) const;
    MStatus getVertices(MIntArray &counts, MIntArray &vertices) const;
    MStatus getUVs(MFloatArray &u, MFloatArray &v, const MString *set = nullptr) const;
    MStatus setUVs(const MFloatArray &u, const MFloatArray &v, const MString *set = nullptr);
    MStatus getAssignedUVs(MIntArray &counts, MIntArray &ids, const MString *set = nullptr) const;
};

class MImage {
public:
    MImage();
    ~MImage();
    MStatus readFromFile(MString path);
    MStatus getSize(unsigned int &width, unsigned int &height) const;
    unsigned char *pixels() const;
};

class MPlug {
public:
    bool operator==(const MObject &attribute) const;
    bool operator!=(const MObject &attribute) const;
};

class MDataHandle {
public:
    MDataHandle(const MDataHandle &other);
    ~MDataHandle();
    MObject asMesh();
    MString &asString() const;
    short &asShort() const;
    int &asInt() const;
    MStatus setMObject(const MObject &data);
    void setClean();
};

class MDataBlock {
public:
    MDataHandle inputValue(const MObject &attribute, MStatus *status = nullptr);
    MDataHandle outputValue(const MObject &attribute, MStatus *status = nullptr);
};

class MPxNode {
public:
    enum SchedulingType { kParallel, kSerial, kGloballySerial, kUntrusted };
    enum Type { kDependNode = 0 };
    MPxNode();
    virtual ~MPxNode();
    virtual MStatus compute(const MPlug &plug, MDataBlock &block);
    virtual SchedulingType schedulingType() const;
    static MStatus addAttribute(const MObject &attribute);
    static MStatus attributeAffects(const MObject &input, const MObject &output);
};

class MFnPlugin {
public:
    explicit MFnPlugin(MObject &object, const char *vendor = "Unknown", const char *version = "Unknown",
                       const char *api = "Any", MStatus *status = nullptr);
    ~MFnPlugin();
    MStatus registerNode(const MString &name, const MTypeId &id, void *(*creator)(), MStatus (*initialize)(),
                         MPxNode::Type type = MPxNode::kDependNode, const MString *classification = nullptr);
    MStatus deregisterNode(const MTypeId &id);
};

class MGlobal {
public:
    static void displayError(const MString &text);
    static void displayWarning(const MString &text);
};

/* In Maya, MFnPlugin.h declares the functions that a plug-in has. */
MStatus initializePlugin(MObject object);
MStatus uninitializePlugin(MObject object);

#endif
