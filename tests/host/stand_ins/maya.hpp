/*
 * Stands in for the Maya devkit, so that the tests compile and run the example in examples/hosts/maya: the few members
 * that it uses, written from the public documentation. What is called stand_in is not Maya's: with it
 * tests/host/stand_ins/maya_example.cpp drives the node.
 */

#ifndef STAND_IN_MAYA_HPP
#define STAND_IN_MAYA_HPP

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

class MString {
public:
    MString() = default;
    MString(const char *text) : text_(text) {}
    const char *asChar() const { return text_.c_str(); }
    unsigned int length() const { return unsigned(text_.size()); }
    MString operator+(const MString &other) const { return MString((text_ + other.text_).c_str()); }
    MString operator+(const char *other) const { return MString((text_ + other).c_str()); }

private:
    std::string text_;
};

class MStatus {
public:
    enum MStatusCode { kSuccess = 0, kFailure, kUnknownParameter };
    MStatus() = default;
    MStatus(MStatusCode code) : code_(code) {}
    operator bool() const { return code_ == kSuccess; }

private:
    MStatusCode code_ = kSuccess;
};
using MS = MStatus;

template <class T> class StandInArray {
public:
    StandInArray() = default;
    StandInArray(const T source[], unsigned int count) : stand_in(source, source + count) {}
    unsigned int length() const { return unsigned(stand_in.size()); }
    MStatus get(T array[]) const
    {
        std::copy(stand_in.begin(), stand_in.end(), array);
        return MS::kSuccess;
    }
    T &operator[](unsigned int index) { return stand_in[index]; }
    T operator[](unsigned int index) const { return stand_in[index]; }

    std::vector<T> stand_in;
};
using MIntArray = StandInArray<int>;
using MFloatArray = StandInArray<float>;

class MPointArray {
public:
    unsigned int length() const { return unsigned(stand_in.size() / 4); }
    MStatus get(double array[][4]) const
    {
        std::memcpy(array, stand_in.data(), stand_in.size() * sizeof(double));
        return MS::kSuccess;
    }
    std::vector<double> stand_in;
};

/* A mesh, and how often its topology was read. */
struct StandInMesh {
    std::vector<double> points;
    std::vector<int> counts, vertices, uv_counts, uv_ids;
    std::vector<float> u, v;
    int reads = 0;
};

/* A mesh or an attribute. */
class MObject {
public:
    bool isNull() const { return stand_in == nullptr; }
    std::shared_ptr<StandInMesh> stand_in;
};
inline MObject stand_in_object() { return MObject{std::make_shared<StandInMesh>()}; }
inline std::map<std::string, MObject> stand_in_attributes;
inline MObject stand_in_attribute(const MString &name)
{
    return stand_in_attributes[name.asChar()] = stand_in_object();
}

class MTypeId {
public:
    explicit MTypeId(unsigned int) {}
};

class MSpace {
public:
    enum Space { kObject };
};

class MFnData {
public:
    enum Type { kString, kMesh };
};

class MFnNumericData {
public:
    enum Type { kInt };
};

class MFnAttribute {
public:
    MStatus setStorable(bool) { return MS::kSuccess; }
    MStatus setWritable(bool) { return MS::kSuccess; }
    MStatus setUsedAsFilename(bool) { return MS::kSuccess; }
};

class MFnTypedAttribute : public MFnAttribute {
public:
    MObject create(const MString &name, const MString &, MFnData::Type) { return stand_in_attribute(name); }
};

class MFnNumericAttribute : public MFnAttribute {
public:
    MObject create(const MString &name, const MString &, MFnNumericData::Type, double)
    {
        return stand_in_attribute(name);
    }
    MStatus setMin(double) { return MS::kSuccess; }
    MStatus setMax(double) { return MS::kSuccess; }
};

class MFnEnumAttribute : public MFnAttribute {
public:
    MObject create(const MString &name, const MString &, short) { return stand_in_attribute(name); }
    MStatus addField(const MString &, short) { return MS::kSuccess; }
};

class MFnMeshData {
public:
    MObject create() { return stand_in_object(); }
};

class MFnMesh {
public:
    MFnMesh() = default;
    explicit MFnMesh(const MObject &object) : mesh_(object.stand_in) {}
    MObject copy(const MObject &source, MObject parent)
    {
        mesh_ = parent.stand_in;
        *mesh_ = *source.stand_in;
        return parent;
    }
    MStatus getPoints(MPointArray &points, MSpace::Space) const
    {
        points.stand_in = mesh_->points;
        return MS::kSuccess;
    }
    MStatus getVertices(MIntArray &counts, MIntArray &vertices) const
    {
        mesh_->reads += 1;
        counts.stand_in = mesh_->counts;
        vertices.stand_in = mesh_->vertices;
        return MS::kSuccess;
    }
    MStatus getUVs(MFloatArray &u, MFloatArray &v) const
    {
        u.stand_in = mesh_->u;
        v.stand_in = mesh_->v;
        return MS::kSuccess;
    }
    MStatus setUVs(const MFloatArray &u, const MFloatArray &v)
    {
        mesh_->u = u.stand_in;
        mesh_->v = v.stand_in;
        return MS::kSuccess;
    }
    MStatus getAssignedUVs(MIntArray &counts, MIntArray &ids) const
    {
        counts.stand_in = mesh_->uv_counts;
        ids.stand_in = mesh_->uv_ids;
        return MS::kSuccess;
    }
    MStatus assignUVs(const MIntArray &counts, const MIntArray &ids)
    {
        mesh_->uv_counts = counts.stand_in;
        mesh_->uv_ids = ids.stand_in;
        return MS::kSuccess;
    }

private:
    std::shared_ptr<StandInMesh> mesh_;
};

/* Reads PGM with 8 bits, the last row first. */
class MImage {
public:
    MStatus readFromFile(MString path)
    {
        std::FILE *file = std::fopen(path.asChar(), "rb");
        if (file == nullptr) {
            return MS::kFailure;
        }
        unsigned most = 0;
        bool good = std::fscanf(file, "P5 %u %u %u", &width_, &height_, &most) == 3 && std::fgetc(file) == '\n';
        pixels_.resize(good ? 4 * std::size_t(width_) * height_ : 0);
        for (unsigned y = height_; good && y-- > 0;) {
            for (unsigned x = 0; x < width_; ++x) {
                const int value = std::fgetc(file);
                good = good && value != EOF;
                std::memset(&pixels_[4 * (std::size_t(y) * width_ + x)], value, 4);
            }
        }
        std::fclose(file);
        return good ? MS::kSuccess : MS::kFailure;
    }
    MStatus getSize(unsigned int &width, unsigned int &height) const
    {
        width = width_;
        height = height_;
        return MS::kSuccess;
    }
    unsigned char *pixels() { return pixels_.data(); }

private:
    unsigned width_ = 0, height_ = 0;
    std::vector<unsigned char> pixels_;
};

class MPlug {
public:
    explicit MPlug(MObject attribute) : attribute_(std::move(attribute)) {}
    bool operator==(const MObject &attribute) const { return attribute_.stand_in == attribute.stand_in; }
    bool operator!=(const MObject &attribute) const { return !(*this == attribute); }

private:
    MObject attribute_;
};

class MPlugArray {};

class MDGContext {
public:
    bool isNormal() const { return stand_in_normal; }
    bool stand_in_normal = true;
};

class MEvaluationNode {
public:
    bool dirtyPlugExists(const MObject &attribute) const { return stand_in.count(attribute.stand_in) != 0; }
    std::set<std::shared_ptr<StandInMesh>> stand_in;
};

struct StandInValue {
    MObject mesh;
    MString text;
    short chosen = 0;
    int number = 0;
};

class MDataHandle {
public:
    explicit MDataHandle(StandInValue &value) : value_(&value) {}
    MObject asMesh() { return value_->mesh; }
    MString &asString() const { return value_->text; }
    short &asShort() const { return value_->chosen; }
    int &asInt() const { return value_->number; }
    MStatus setMObject(const MObject &data)
    {
        value_->mesh = data;
        return MS::kSuccess;
    }
    void setClean() {}

private:
    StandInValue *value_;
};

class MDataBlock {
public:
    MDataHandle inputValue(const MObject &attribute) { return MDataHandle(stand_in[attribute.stand_in]); }
    MDataHandle outputValue(const MObject &attribute) { return inputValue(attribute); }
    MDGContext context() const { return stand_in_context; }

    std::map<std::shared_ptr<StandInMesh>, StandInValue> stand_in;
    MDGContext stand_in_context;
};

class MPxNode {
public:
    enum SchedulingType { kParallel, kSerial, kGloballySerial, kUntrusted };
    virtual ~MPxNode() = default;
    virtual MStatus compute(const MPlug &, MDataBlock &) { return MS::kUnknownParameter; }
    virtual SchedulingType schedulingType() const { return kSerial; }
    virtual MStatus setDependentsDirty(const MPlug &, MPlugArray &) { return MS::kSuccess; }
    virtual MStatus preEvaluation(const MDGContext &, const MEvaluationNode &) { return MS::kSuccess; }
    static MStatus addAttribute(const MObject &) { return MS::kSuccess; }
    static MStatus attributeAffects(const MObject &input, const MObject &)
    {
        stand_in_affecting.insert(input.stand_in);
        return MS::kSuccess;
    }
    static inline std::set<std::shared_ptr<StandInMesh>> stand_in_affecting;
};

inline void *(*stand_in_creator)() = nullptr;

class MFnPlugin {
public:
    explicit MFnPlugin(MObject &, const char * = "Unknown", const char * = "Unknown") {}
    MStatus registerNode(const MString &, const MTypeId &, void *(*creator)(), MStatus (*initialize)())
    {
        stand_in_creator = creator;
        return initialize();
    }
    MStatus deregisterNode(const MTypeId &) { return MS::kSuccess; }
};

/* What the user was told. */
inline std::vector<std::string> stand_in_said;

class MGlobal {
public:
    static void displayError(const MString &text) { say("error: ", text); }
    static void displayWarning(const MString &text) { say("warning: ", text); }

private:
    static void say(const char *kind, const MString &text)
    {
        static std::mutex mutex;
        const std::lock_guard<std::mutex> lock(mutex);
        stand_in_said.push_back(std::string(kind) + text.asChar());
    }
};

/* In Maya, MFnPlugin.h declares the functions that a plug-in has. */
MStatus initializePlugin(MObject object);
MStatus uninitializePlugin(MObject object);

#endif
