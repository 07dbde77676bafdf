from inspector.recording.recording import linked

ENTITIES = {"arm_2_link": "/robot/arm/visual_geometries/arm_2_link"}


def test_links_before_their_share_point_to_the_robot():
    row = "| impact | 1.00 | 2.00 | arm_2_link 60%, hand 40% |"
    there = "[arm_2_link](recording://robot/arm/visual_geometries/arm_2_link)"
    assert linked(row, ENTITIES) == f"| impact | 1.00 | 2.00 | {there} 60%, hand 40% |"


def test_names_elsewhere_are_left_alone():
    text = "- Links without geometry make no noise: arm_2_link.\n- 60% of arm_2_link"
    assert linked(text, ENTITIES) == text
