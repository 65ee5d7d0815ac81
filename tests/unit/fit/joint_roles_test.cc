// Names of the joints of well-known skeletons mean the roles that they have there.
#include "fit/joint_roles.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace dcloth::testing {
namespace {

struct Naming {
  const char* what;
  // In the order of the roles from the hips on, without those of the trunk; empty where the naming has none.
  std::vector<std::string> hips_neck_head;
  std::vector<std::string> left;  // shoulder, upper arm, lower arm, hand, upper leg, lower leg, foot, toes
  std::vector<std::string> right;
  std::vector<std::string> trunk;
};

const std::vector<Naming>& Namings() {
  static const std::vector<Naming> namings = {
      {"Mixamo",
       {"mixamorig:Hips", "mixamorig:Neck", "mixamorig:Head"},
       {"mixamorig:LeftShoulder", "mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand",
        "mixamorig:LeftUpLeg", "mixamorig:LeftLeg", "mixamorig:LeftFoot", "mixamorig:LeftToeBase"},
       {"mixamorig:RightShoulder", "mixamorig:RightArm", "mixamorig:RightForeArm", "mixamorig:RightHand",
        "mixamorig:RightUpLeg", "mixamorig:RightLeg", "mixamorig:RightFoot", "mixamorig:RightToeBase"},
       {"mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"}},
      {"Mixamo with a number and no colon",
       {"mixamorig7Hips", "mixamorig7:Neck", "mixamorigHead"},
       {"mixamorig7LeftShoulder", "mixamorig7:LeftArm", "mixamorigLeftForeArm", "LeftHand", "LeftUpLeg",
        "mixamorig_LeftLeg", "mixamorig1:LeftFoot", "mixamorig12LeftToeBase"},
       {"mixamorig7RightShoulder", "mixamorig7:RightArm", "mixamorigRightForeArm", "RightHand", "RightUpLeg",
        "mixamorig_RightLeg", "mixamorig1:RightFoot", "mixamorig12RightToeBase"},
       {"mixamorig7Spine", "mixamorig7:Spine1", "mixamorigSpine2"}},
      {"HumanIK",
       {"Character1_Hips", "Character1_Neck", "Character1_Head"},
       {"Character1_LeftShoulder", "Character1_LeftArm", "Character1_LeftForeArm", "Character1_LeftHand",
        "Character1_LeftUpLeg", "Character12_LeftLeg", "Character1_LeftFoot", "Character1_LeftToeBase"},
       {"Character1_RightShoulder", "Character1_RightArm", "Character1_RightForeArm", "Character1_RightHand",
        "Character1_RightUpLeg", "Character12_RightLeg", "Character1_RightFoot", "Character1_RightToeBase"},
       {"Character1_Spine", "Character1_Spine1", "Character1_Spine2"}},
      {"Unity Humanoid",
       {"Hips", "Neck", "Head"},
       {"LeftShoulder", "LeftUpperArm", "LeftLowerArm", "LeftHand", "LeftUpperLeg", "LeftLowerLeg", "LeftFoot",
        "LeftToes"},
       {"RightShoulder", "RightUpperArm", "RightLowerArm", "RightHand", "RightUpperLeg", "RightLowerLeg", "RightFoot",
        "RightToes"},
       {"Spine", "Chest", "UpperChest"}},
      {"Unreal",
       {"pelvis", "neck_01", "head"},
       {"clavicle_l", "upperarm_l", "lowerarm_l", "hand_l", "thigh_l", "calf_l", "foot_l", "ball_l"},
       {"clavicle_r", "upperarm_r", "lowerarm_r", "hand_r", "thigh_r", "calf_r", "foot_r", "ball_r"},
       {"spine_01", "spine_02", "spine_03", "spine_04", "spine_05"}},
      {"MakeHuman, default rig",
       {"root", "neck01", "head"},
       {"clavicle.L", "upperarm01.L", "lowerarm01.L", "wrist.L", "upperleg01.L", "lowerleg01.L", "foot.L", ""},
       {"clavicle.R", "upperarm01.R", "lowerarm01.R", "wrist.R", "upperleg01.R", "lowerleg01.R", "foot.R", ""},
       {"spine05", "spine03", "spine01"}},
      {"Rigify",
       {"", "", ""},
       {"DEF-shoulder.L", "DEF-upper_arm.L", "DEF-forearm.L", "DEF-hand.L", "DEF-thigh.L", "DEF-shin.L", "DEF-foot.L",
        "DEF-toe.L"},
       {"DEF-shoulder.R", "DEF-upper_arm.R", "DEF-forearm.R", "DEF-hand.R", "DEF-thigh.R", "DEF-shin.R", "DEF-foot.R",
        "DEF-toe.R"},
       {"DEF-spine.001", "DEF-spine.002", "DEF-spine.003"}},
      {"VRM, as VRoid writes it",
       {"J_Bip_C_Hips", "J_Bip_C_Neck", "J_Bip_C_Head"},
       {"J_Bip_L_Shoulder", "J_Bip_L_UpperArm", "J_Bip_L_LowerArm", "J_Bip_L_Hand", "J_Bip_L_UpperLeg",
        "J_Bip_L_LowerLeg", "J_Bip_L_Foot", "J_Bip_L_ToeBase"},
       {"J_Bip_R_Shoulder", "J_Bip_R_UpperArm", "J_Bip_R_LowerArm", "J_Bip_R_Hand", "J_Bip_R_UpperLeg",
        "J_Bip_R_LowerLeg", "J_Bip_R_Foot", "J_Bip_R_ToeBase"},
       {"J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_UpperChest"}},
      {"CMU",
       {"Hips", "Neck", "Head"},
       {"LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"},
       {"RightShoulder", "RightArm", "RightForeArm", "RightHand", "RightUpLeg", "RightLeg", "RightFoot",
        "RightToeBase"},
       {"LowerBack", "Spine", "Spine1"}},
      {"Biped",
       {"Bip01 Pelvis", "Bip01 Neck", "Bip01 Head"},
       {"Bip01 L Clavicle", "Bip01 L UpperArm", "Bip01 L Forearm", "Bip01 L Hand", "Bip01 L Thigh", "Bip01 L Calf",
        "Bip01 L Foot", "Bip01 L Toe0"},
       {"Bip01 R Clavicle", "Bip01 R UpperArm", "Bip01 R Forearm", "Bip01 R Hand", "Bip01 R Thigh", "Bip01 R Calf",
        "Bip01 R Foot", "Bip01 R Toe0"},
       {"Bip01 Spine", "Bip01 Spine1", "Bip01 Spine2"}},
      {"Character Creator",
       {"CC_Base_Hip", "CC_Base_NeckTwist01", "CC_Base_Head"},
       {"CC_Base_L_Clavicle", "CC_Base_L_Upperarm", "CC_Base_L_Forearm", "CC_Base_L_Hand", "CC_Base_L_Thigh",
        "CC_Base_L_Calf", "CC_Base_L_Foot", "CC_Base_L_ToeBase"},
       {"CC_Base_R_Clavicle", "CC_Base_R_Upperarm", "CC_Base_R_Forearm", "CC_Base_R_Hand", "CC_Base_R_Thigh",
        "CC_Base_R_Calf", "CC_Base_R_Foot", "CC_Base_R_ToeBase"},
       {"CC_Base_Waist", "CC_Base_Spine01", "CC_Base_Spine02"}},
      {"words with a tail, a side in one letter",
       {"HipsBone", "NeckBone", "HeadBone"},
       {"LeftShoulderBone", "lShldrBend", "LeftLowerArmBone", "lHand", "lThighBend", "lShin", "upperleg_foot_left", ""},
       {"RightShoulderBone", "rShldrBend", "RightLowerArmBone", "rHand", "rThighBend", "rShin", "", ""},
       {"SpineBone", "ChestBone", "abdomenLower"}},
  };
  return namings;
}

uint32_t Role(const std::string& name) {
  uint32_t rank = 99;
  const uint32_t role = fit::RoleOf(name.c_str(), false, 0, &rank);
  EXPECT_EQ(role == DCLOTH_ROLE_NONE, rank == 99);
  return role;
}

TEST(JointRolesTest, KnowsTheNamings) {
  constexpr uint32_t kMiddle[] = {DCLOTH_ROLE_HIPS, DCLOTH_ROLE_NECK, DCLOTH_ROLE_HEAD};
  constexpr uint32_t kLeft[] = {DCLOTH_ROLE_LEFT_SHOULDER, DCLOTH_ROLE_LEFT_UPPER_ARM, DCLOTH_ROLE_LEFT_LOWER_ARM,
                                DCLOTH_ROLE_LEFT_HAND,     DCLOTH_ROLE_LEFT_UPPER_LEG, DCLOTH_ROLE_LEFT_LOWER_LEG,
                                DCLOTH_ROLE_LEFT_FOOT,     DCLOTH_ROLE_LEFT_TOES};
  size_t names = 0;
  for (const Naming& naming : Namings()) {
    SCOPED_TRACE(naming.what);
    const auto expect = [&](const std::string& name, uint32_t role) {
      if (name.empty() || name == "upperleg_foot_left") return;
      EXPECT_EQ(Role(name), role) << name;
      ++names;
    };
    for (size_t i = 0; i < 3; ++i) expect(naming.hips_neck_head[i], kMiddle[i]);
    for (size_t i = 0; i < 8; ++i) {
      expect(naming.left[i], kLeft[i]);
      expect(naming.right[i], fit::OtherSide(kLeft[i]));
    }
    for (const std::string& name : naming.trunk) EXPECT_TRUE(fit::IsTrunkName(name.c_str(), false)) << name;
  }
  EXPECT_GT(names, 180u);
}

// Twist bones, fingers, ends, controls, hair: nobody takes them for the joint that they belong to.
TEST(JointRolesTest, LeavesOtherJointsAlone) {
  for (const char* name : {"mixamorig:LeftHandIndex1",
                           "mixamorig:HeadTop_End",
                           "mixamorig:LeftToe_End",
                           "upperarm_twist_01_l",
                           "thigh_twist_01_r",
                           "DEF-thigh.L.001",
                           "lowerleg02.R",
                           "upperarm02.L",
                           "LHipJoint",
                           "LeftFingerBase",
                           "J_Sec_L_Bust1",
                           "eye.L",
                           "jaw",
                           "foot_ik.L",
                           "hand_ik_l",
                           "ik_foot_root",
                           "breast.L",
                           "pelvis.L",
                           "CC_Base_L_ThighTwist01",
                           "Armature",
                           "",
                           ":",
                           "::",
                           "l",
                           "_",
                           "handslot.r"}) {
    EXPECT_EQ(Role(name), uint32_t{DCLOTH_ROLE_NONE}) << name;
  }
  EXPECT_EQ(fit::RoleOf(nullptr, false, 0, nullptr), uint32_t{DCLOTH_ROLE_NONE});
  for (const char* name : {"spine_ik_l", "Spine_L", "neck", "hips", "chestplate", "spinetwist"})
    EXPECT_FALSE(fit::IsTrunkName(name, false)) << name;
}

TEST(JointRolesTest, PrefixesEndInASeparator) {
  const auto prefix = [](const std::string& name, size_t most = 64) {
    return name.substr(0, fit::SizeOfPrefix(name.c_str(), most));
  };
  EXPECT_EQ(prefix("Hero_Rig:LeftArm"), "Hero_Rig:");
  EXPECT_EQ(prefix("Hero_Rig:LeftArm", 8), "Hero_");
  EXPECT_EQ(prefix("Hero_Rig:LeftArm", 4), "");
  EXPECT_EQ(prefix("Hero_"), "");
  EXPECT_EQ(prefix("LeftArm"), "");
  EXPECT_EQ(prefix(""), "");
}

// Names come out of files: any bytes and any length are names like others.
TEST(JointRolesTest, TakesAnyBytes) {
  std::string name(5000, 'l');
  EXPECT_EQ(Role(name), uint32_t{DCLOTH_ROLE_NONE});
  for (int byte = 1; byte < 256; ++byte) {
    for (const size_t length : {size_t{1}, size_t{63}, size_t{64}, size_t{65}, size_t{200}}) {
      name.assign(length, static_cast<char>(byte));
      Role(name);
      Role("left" + name + "arm");
    }
  }
}

TEST(JointRolesTest, SidesAndNamesBelongTogether) {
  for (uint32_t role = 0; role < fit::kRoleCount; ++role) {
    const std::string name = fit::RoleName(role), other = fit::RoleName(fit::OtherSide(role));
    EXPECT_EQ(fit::OtherSide(fit::OtherSide(role)), role);
    if (name.rfind("left ", 0) == 0) {
      EXPECT_EQ(other, "right " + name.substr(5));
    } else if (name.rfind("right ", 0) != 0) {
      EXPECT_EQ(other, name);
    }
  }
  EXPECT_EQ(fit::RoleName(fit::kRoleCount), nullptr);
}

}  // namespace
}  // namespace dcloth::testing
